"""The report is one page with everything in it, the same bytes every time, and says what it could not draw."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

import sloshpy
from sloshpy.assess import Assessment, assess
from sloshpy.autopilot import Autopilot
from sloshpy.case import Case, Source
from sloshpy.damping import ConstantDamping, PowerDamping, TableDamping
from sloshpy.files import read_case, write_example
from sloshpy.report import figures, report_html, write_figures, write_report
from sloshpy.report.inputs import input_rows
from sloshpy.vehicle import SloshMass

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Page(HTMLParser):
    """Checks that tags close in order, and keeps text and attributes."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []
        self.tags: list[str] = []
        self.links: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [v or "" for k, v in attrs if k in {"href", "src", "xlink:href"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    @property
    def words(self) -> str:
        return " ".join(" ".join(self.text).split())


@pytest.fixture(scope="module")
def review(tmp_path_factory: pytest.TempPathFactory) -> Assessment:
    return assess(read_case(write_example("upper_stage", tmp_path_factory.mktemp("case"))))


@pytest.fixture(scope="module")
def page(review: Assessment) -> Page:
    return Page(report_html(review))


def changed(review: Assessment, **tank: object) -> Case:
    vehicle = review.case.vehicle
    return review.case.model_copy(
        update={"vehicle": vehicle.model_copy(update={"tanks": (vehicle.tanks[0].model_copy(update=tank),)})}
    )


def test_the_page_is_well_formed_and_needs_nothing_from_outside(page: Page) -> None:
    assert page.open == []
    assert "script" not in page.tags
    assert all(link.startswith("#") for link in page.links)


def test_the_page_opens_with_name_verdict_and_reasons(review: Assessment, page: Page) -> None:
    text = page.words
    assert text.index(review.case.name) < text.index("PASS") < text.index("Criteria")
    assert all(reason in text for reason in review.reasons)


def test_every_figure_of_the_paper_from_four_to_nine_is_there(page: Page) -> None:
    assert [n for n in "456789" if f"Figure {n} of the paper" in page.words] == list("456789")
    assert page.tags.count("svg") == 10
    assert "Not drawn" not in page.words


def test_the_page_holds_the_numbers_of_the_assessment(page: Page) -> None:
    for number in (
        "4.7358 %",
        "2.3929 %",
        "0.4436 m",
        "0.4736 m",
        "4.978 to 5.334 mrad",
        "+170.9 ms",
        "13.18 m behind",
    ):
        assert number in page.words


def test_inputs_stand_as_given_and_in_si(review: Assessment, page: Page) -> None:
    rows = {row.key: row for row in input_rows(review.case)}
    assert rows["vehicle.thrust"].given == "900 kN"
    assert rows["vehicle.thrust"].value.startswith("900000 N (")
    assert rows["tank.LOX.damping.slope"].value == "0.1 1/m"
    assert rows["vehicle.mass"].symbol == "M"
    assert "900 kN" in page.words


def test_the_parts_of_a_sum_law_stand_as_given() -> None:
    rows = {row.key: row for row in input_rows(read_case(Path(sloshpy.__file__).parent / "data" / "two_tanks.toml"))}
    assert rows["tank.LOX.damping.of.1.ratio"].given == "0.1 %"
    assert rows["tank.LOX.damping.of.2.slope"].given == "0.12 1/m"


def test_a_case_in_place_of_an_assessment_is_told_the_way(review: Assessment, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="assess"):
        write_report(review.case, tmp_path / "page.html")  # type: ignore[arg-type]


def test_every_number_of_a_case_file_is_an_input_row(review: Assessment) -> None:
    assert review.case.source is not None
    given = {key for key in review.case.source.given if not key.endswith("name")}
    assert given <= {row.key for row in input_rows(review.case)}


def test_file_name_and_hash_of_the_case_are_on_the_page(review: Assessment, page: Page) -> None:
    assert review.case.source is not None
    assert review.case.source.file in page.words
    assert review.case.source.sha256 in page.words


def test_text_of_the_case_file_is_escaped(review: Assessment) -> None:
    nasty = "<script>alert('x')</script>"
    source = Source(file=f"{nasty}.toml", sha256="0" * 64, given={"vehicle.mass": f"16000 kg {nasty}"})
    found = report_html(assess(review.case.model_copy(update={"source": source})))
    assert "<script" not in found
    assert Page(found).words.count("<script>alert") == 2


def test_two_reports_of_one_case_are_the_same_bytes_without_a_date(review: Assessment, tmp_path: Path) -> None:
    one = write_report(review, tmp_path / "one.html").read_bytes()
    assert one == write_report(assess(review.case), tmp_path / "two.html").read_bytes()
    assert not re.search(rb"20\d\d-\d\d-\d\d", one)


def test_names_inside_the_drawings_do_not_repeat_on_the_page(review: Assessment) -> None:
    names = re.findall(r' id="([^"]*)"', report_html(review))
    assert len(names) == len(set(names))


def test_a_loop_without_limit_cycle_says_why_in_place_of_the_figures(review: Assessment) -> None:
    found = assess(changed(review, damping=ConstantDamping(ratio=0.005)))
    text = Page(report_html(found)).words
    assert "FAIL" in text
    assert text.count("Not drawn: ") >= 2
    assert "stays below the required 4.736 % at every amplitude" in text


def test_an_unstable_loop_with_two_tanks_has_a_page(review: Assessment) -> None:
    second = SloshMass(
        name="LH2", slosh_mass=500.0, station=3.0, frequency=2.6, radius=2.0,
        damping=TableDamping(amplitude=[0.05, 0.3, 0.6], ratio=[0.002, 0.03, 0.05]),
    )  # fmt: skip
    vehicle = review.case.vehicle.model_copy(update={"tanks": (*review.case.vehicle.tanks, second)})
    page = Page(report_html(assess(review.case.model_copy(update={"vehicle": vehicle}))))
    assert "LH2" in page.words
    assert "2 modes grow at once" in page.words
    assert "one sinusoid predicts no limit cycle here" in page.words
    assert page.open == []


def test_tanks_that_need_no_damping_have_a_page(review: Assessment) -> None:
    text = Page(report_html(assess(changed(review, station=17.0)))).words
    assert "none needed" in text


def test_a_loop_beyond_rescue_has_a_page(review: Assessment) -> None:
    lost = review.case.model_copy(update={"autopilot": Autopilot(attitude_gain=0.08, rate_gain=0.14, delay=1.2)})
    text = Page(report_html(assess(lost))).words
    assert "none suffices" in text


def test_an_invalid_verdict_has_a_page_that_gives_no_margin(review: Assessment) -> None:
    from dataclasses import replace

    doubted = replace(review, verdict="invalid", margins=replace(review.margins, witness=True))
    assert not doubted.margins.trusted
    text = Page(report_html(doubted)).words
    assert "INVALID" in text
    assert "phase margin" not in text
    assert "encirclement count disagree" in text


def test_cautions_stand_among_the_assumptions(review: Assessment) -> None:
    found = assess(changed(review, radius=1.0, damping=PowerDamping(slope=0.1)))
    assert "Raised for this case:" in Page(report_html(found)).words


def test_a_folder_of_figures_holds_one_file_for_each(review: Assessment, tmp_path: Path) -> None:
    written = write_figures(review, tmp_path / "new" / "figures", "svg")
    assert len(written) == len(figures(review)) == 10
    assert {p.name[:4] for p in written} >= {f"fig{n}" for n in range(4, 10)}
    assert all(p.stat().st_size > 1000 for p in written)
