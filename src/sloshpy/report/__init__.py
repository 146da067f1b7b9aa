"""An assessment as a page and as a folder of figures."""

from sloshpy.report.campaign_figures import write_campaign_figures
from sloshpy.report.figures import ReportFigure, figures, write_figures
from sloshpy.report.flight_figures import write_flight_figures
from sloshpy.report.flight_report import flight_report_html, write_flight_report
from sloshpy.report.report import report_html, write_report

__all__ = [
    "ReportFigure",
    "figures",
    "flight_report_html",
    "report_html",
    "write_campaign_figures",
    "write_figures",
    "write_flight_figures",
    "write_flight_report",
    "write_report",
]
