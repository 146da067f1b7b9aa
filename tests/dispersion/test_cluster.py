"""A cluster of dask.distributed gives the bits of this machine, by TLS beyond the loopback, and is checked.

The cluster in threads of this process takes a second; those of processes stand behind `make test-faults`.
"""

import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from uncertain import RUN, crashing, hanging, stage, toy

from sloshpy.cli import main
from sloshpy.dispersion import Cluster, read_campaign, run_campaign
from sloshpy.dispersion import campaign as campaign_room
from sloshpy.dispersion import cluster as cluster_room
from sloshpy.dispersion.block import encoded
from sloshpy.dispersion.cluster import answer_there, arrived, computed_there, environment_there, is_loopback
from sloshpy.dispersion.rows import Status, joined
from sloshpy.dispersion.store import Layout
from sloshpy.errors import InputError
from sloshpy.files import read_dispersion, write_example

distributed = pytest.importorskip("distributed", reason="the extra sloshpy[cluster] is not installed")


@pytest.fixture
def one_thread(monkeypatch):
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")


@pytest.fixture
def there(one_thread):
    """A scheduler and a worker in threads of this process, on the loopback, without a dashboard."""
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        host="127.0.0.1",
        dashboard_address=None,
        worker_dashboard_address=None,
    ) as found:
        yield found.scheduler_address


def processes(count=2, **more):
    return distributed.LocalCluster(
        n_workers=count, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None, **more
    )


@pytest.mark.parametrize("analysis", [None, RUN])
def test_a_cluster_gives_the_same_bits_and_fills_a_store(there, analysis, tmp_path, monkeypatch):
    monkeypatch.setattr(campaign_room, "BLOCK", 20)
    here = run_campaign(stage(analysis), 50, 3)
    told = []
    found = run_campaign(
        stage(analysis), 50, 3, cluster=Cluster(address=there), store=tmp_path / "s", watch=lambda *x: told.append(x)
    )
    assert found.digest == here.digest
    assert np.array_equal(found.values, here.values, equal_nan=True)
    assert told[0] == (0, 50)
    assert told[-1] == (50, 50)
    assert read_campaign(stage(analysis), tmp_path / "s").digest == here.digest


def test_the_command_is_the_same_with_a_cluster(there, tmp_path, capsys):
    write_example("upper_stage", tmp_path)
    file = write_example("upper_stage_dispersed", tmp_path)
    words = ["disperse", str(file), "--cases", "30", "--seed", "3", "--json"]
    said = []
    for more in (["--workers", "1"], ["--cluster", there.removeprefix("tcp://")]):
        with pytest.raises(SystemExit) as ended:
            main([*words, *more])
        assert ended.value.code == 1
        said.append(json.loads(capsys.readouterr().out))
    assert said[0]["digest"] == said[1]["digest"]
    assert len(said[0]["digest"]) == 64
    with pytest.raises(SystemExit) as ended:
        main([*words, "--workers", "2", "--cluster", there])
    assert ended.value.code == 2
    assert "--workers" in capsys.readouterr().err


def test_a_worker_of_another_environment_is_refused_with_the_difference(there, monkeypatch):
    monkeypatch.setattr(cluster_room, "environment_there", lambda: json.dumps({"numpy": "1.0", "threads": "1"}))
    with pytest.raises(InputError, match=r"numpy: 1\.0 there") as refused:
        run_campaign(stage(), 5, 3, cluster=Cluster(address=there))
    assert "sloshpy: None there" in str(refused.value)


def test_what_is_not_what_was_asked_for_is_not_taken(one_thread):
    sent = answer_there(toy, 3, 30, 10, 2)
    taken = partial(arrived, worker="w", number=3, first=30, count=10, columns=2)
    assert np.array_equal(taken(sent).values, toy(30, 10).values)
    for k in range(0, len(sent["block"]), 7):
        flipped = bytearray(sent["block"])
        flipped[k] ^= 1
        assert taken(sent | {"block": bytes(flipped)}) is None
    own, rows = sent["environment"], toy(30, 10)
    assert taken(sent | {"block": encoded(4, rows, own)}) is None
    assert taken(sent | {"block": encoded(3, toy(31, 10), own)}) is None
    assert taken(sent | {"block": encoded(3, toy(30, 9), own)}) is None
    rows.values[4, 0] = np.nan
    assert taken(sent | {"block": encoded(3, rows, own)}) is None
    for strange in (None, b"", {}, {"block": 3}, {"block": sent["block"]}, sent | {"block": b"sloshpy block 1\n{}\n"}):
        assert taken(strange) is None
    with pytest.raises(InputError, match="python: 2 there"):
        taken(sent | {"environment": json.dumps(json.loads(own) | {"python": "2"})})
    with pytest.raises(InputError, match="threads: 8 there, 1 now"):
        taken(sent | {"environment": json.dumps(json.loads(own) | {"threads": "8"})})


@pytest.fixture
def pem(tmp_path):
    """Certificate of an authority, own certificate and key: three files."""
    files = {}
    made = distributed.Security.temporary()
    for name, text in (("ca", made.tls_ca_file), ("cert", made.tls_client_cert), ("key", made.tls_client_key)):
        files[name] = tmp_path / f"{name}.pem"
        files[name].write_text(text)
    return files


@pytest.mark.parametrize(
    ("address", "secure", "told"),
    [
        ("tcp://10.0.0.3:8786", False, "is not the loopback"),
        ("10.0.0.3:8786", False, "is not the loopback"),
        ("tcp://scheduler.example:8786", False, "is not the loopback"),
        ("tcp://[2001:db8::1]:8786", False, "is not the loopback"),
        ("0.0.0.0:8786", False, "is not the loopback"),
        ("tcp://127.0.0.1.example.org:8786", False, "is not the loopback"),
        ("tls://10.0.0.3:8786", False, "needs certificates"),
        ("tcp://10.0.0.3:8786", True, "is spoken to in clear"),
        ("127.0.0.1", False, "is no address"),
        ("tcp://127.0.0.1:x", False, "is no address"),
        ("http://127.0.0.1:80", False, "is no address"),
        ("", False, "is no address"),
    ],
)
def test_an_address_in_clear_beyond_the_loopback_is_refused(address, secure, told, pem):
    with pytest.raises(InputError, match=told):
        Cluster(address=address, **(pem if secure else {}))


def test_certificates_are_files_and_all_three(pem):
    assert Cluster(address="10.0.0.3:8786", **pem).url == "tls://10.0.0.3:8786"
    assert Cluster(address="tls://host.example:8786", **pem).secure
    assert Cluster(address="localhost:8786").url == "tcp://localhost:8786"
    assert Cluster(address="tcp://[::1]:8786").url == "tcp://[::1]:8786"
    with pytest.raises(InputError, match="missing beside"):
        Cluster(address="10.0.0.3:8786", ca=pem["ca"], cert=pem["cert"])
    with pytest.raises(InputError, match="is no file"):
        Cluster(address="10.0.0.3:8786", **(pem | {"key": Path("none.pem")}))
    assert [is_loopback(x) for x in ("127.0.0.9", "::1", "localhost", "10.0.0.1", "", "example")] == [True] * 3 + [
        False
    ] * 3


def test_a_scheduler_that_is_not_there_or_has_no_worker_is_told(monkeypatch):
    monkeypatch.setattr(cluster_room, "CONNECT", 1.0)
    with pytest.raises(InputError, match="does not answer"):
        run_campaign(stage(), 5, 3, cluster=Cluster(address="127.0.0.1:9"))
    with (
        distributed.LocalCluster(n_workers=0, processes=False, protocol="tcp", dashboard_address=None) as empty,
        pytest.raises(InputError, match="has no worker"),
    ):
        run_campaign(stage(), 5, 3, cluster=Cluster(address=empty.scheduler_address))


LAYOUT = Layout(cases=24, block=6, columns=("a", "b"))


def table(cluster, answer, limit=20.0):
    found = dict(computed_there(cluster, answer, LAYOUT, LAYOUT.numbers, limit))
    assert sorted(found) == list(LAYOUT.numbers)
    return joined([found[number] for number in LAYOUT.numbers])


@pytest.mark.faults
@pytest.mark.parametrize("analysis", [None, RUN])
def test_worker_processes_give_the_same_bits(analysis, monkeypatch):
    monkeypatch.setattr(campaign_room, "BLOCK", 30)
    here = run_campaign(stage(analysis), 150, 3).digest
    for count in (1, 2):
        with processes(count) as found:
            assert (
                run_campaign(stage(analysis), 150, 3, cluster=Cluster(address=found.scheduler_address)).digest == here
            )


@pytest.mark.faults
def test_a_case_that_kills_or_hangs_its_workers_costs_itself_alone(monkeypatch):
    monkeypatch.setattr(cluster_room, "START", 8.0)
    expected, others = toy(0, 24), np.arange(24) != 7
    for answer, limit, status in ((crashing, 20.0, Status.CRASHED), (hanging, 1.0, Status.TIMEOUT)):
        with processes() as found:
            rows = table(Cluster(address=found.scheduler_address), answer, limit)
        assert rows.status[7] == status
        assert np.all(rows.status[others] == Status.OK)
        assert np.array_equal(rows.values[others], expected.values[others])


@pytest.mark.faults
def test_by_mutual_tls_alone(pem, tmp_path, monkeypatch):
    """A scheduler that asks for certificates serves ours, and nobody without or with those of another authority."""
    monkeypatch.setattr(cluster_room, "CONNECT", 10.0)
    ca, cert, key = (str(pem[name]) for name in ("ca", "cert", "key"))
    secure = distributed.Security(
        tls_ca_file=ca,
        **{
            f"tls_{who}_{what}": {"cert": cert, "key": key}[what]
            for who in ("scheduler", "worker", "client")
            for what in ("cert", "key")
        },
        require_encryption=True,
    )
    with processes(1, protocol="tls", security=secure) as found:
        address = found.scheduler_address
        assert address.startswith("tls://")
        own = Cluster(address=address, **pem)
        assert np.array_equal(table(own, toy).values, toy(0, 24).values)
        with pytest.raises(InputError, match="does not answer"):
            table(Cluster(address=address.replace("tls://", "tcp://")), toy)
        other = tmp_path / "other"
        other.mkdir()
        made, theirs = distributed.Security.temporary(), {}
        for name, text in (("ca", made.tls_ca_file), ("cert", made.tls_client_cert), ("key", made.tls_client_key)):
            theirs[name] = other / f"{name}.pem"
            theirs[name].write_text(text)
        with pytest.raises(InputError, match="does not answer"):
            table(Cluster(address=address, **theirs), toy)


@pytest.mark.faults
def test_by_the_commands_of_the_documentation(tmp_path):
    write_example("upper_stage", tmp_path)
    file = write_example("upper_stage_dispersed", tmp_path)
    folder = Path(sys.executable).parent
    local = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = subprocess.Popen(
        [folder / "dask", "scheduler", *local, "--port", "0", "--scheduler-file", tmp_path / "s.json"],
        stderr=subprocess.DEVNULL,
    )
    worker = subprocess.Popen(
        [
            folder / "dask",
            "worker",
            "--scheduler-file",
            tmp_path / "s.json",
            *local,
            "--nworkers",
            "2",
            "--nthreads",
            "1",
        ],
        stderr=subprocess.DEVNULL,
    )
    try:
        for _ in range(200):
            if (tmp_path / "s.json").exists():
                break
            subprocess.run(["sleep", "0.1"], check=True)
        address = json.loads((tmp_path / "s.json").read_text())["address"]
        words = [folder / "sloshpy", "disperse", file, "--cases", "2000", "--seed", "4", "--cluster", address, "--json"]
        ended = subprocess.run(words, capture_output=True, text=True, timeout=200)
        assert ended.returncode in {0, 1}, ended.stderr
        assert json.loads(ended.stdout)["digest"] == run_campaign(read_dispersion(file), 2000, 4).digest
    finally:
        for process in (worker, scheduler):
            process.terminate()
            process.wait(30)


def test_what_a_worker_says_of_itself_names_its_threads(one_thread):
    assert json.loads(environment_there())["threads"] == "1"
