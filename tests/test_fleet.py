"""Many tasks: the same outcomes by every executor, limits told, dead processes survived, shards made one again."""

import csv
import json
import multiprocessing
import os
import random
import sys
import time
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from experiments.studies.kills import Cluster
from symrefine.errors import InputError
from symrefine.fleet import cell, journal
from symrefine.fleet.cluster import Dask
from symrefine.fleet.crew import HERE, Executor, Processes, on_this_machine
from symrefine.fleet.journal import opened, passing, read_rows
from symrefine.fleet.limits import Limits, Lost
from symrefine.fleet.rows import Rows
from symrefine.fleet.shard import Shard, Whole, merged, piece
from symrefine.fleet.table import flat, write_table
from symrefine.fleet.tasks import finish, is_final

WORK = """
import os
import signal
import time
from pathlib import Path


def square(x):
    return {"x": x, "square": x * x, "third": x / 3}


def slowly(x):
    time.sleep(0.2)
    return square(x)


def whose(_):
    time.sleep(0.05)
    return os.getpid(), os.environ["OMP_NUM_THREADS"]


def folder(_):
    return str(Path.cwd())


def hostile(x):
    if x == 1:
        time.sleep(60)
    if x == 2:
        bytearray(10**10)
    if x == 3:
        os.kill(os.getpid(), signal.SIGSEGV)
    if x == 4:
        raise OSError(5, "not the fault of anybody here")
    return x


def killed_once(mark):
    if mark and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return mark


def killed_always(x):
    if x == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return x
"""
posix = pytest.mark.skipif(os.name != "posix", reason="sends signals")
linux = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are for Linux")


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A module that other processes can import."""
    (tmp_path / "fleet_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # for what is started as a command of its own
    monkeypatch.delitem(sys.modules, "fleet_work", raising=False)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    import fleet_work

    return fleet_work


def outcomes(executor: Executor, function: Callable[[Any], Any], parcels: list[Any]) -> list[Any]:
    found = dict(executor.do(function, parcels))
    assert sorted(found) == list(range(len(parcels)))
    return [found[index] for index in sorted(found)]


# --- processes --------------------------------------------------------------------------------------------------------


def test_processes_give_what_this_process_gives(work: Any) -> None:
    parcels = list(range(7))
    assert outcomes(Processes(workers=3), work.square, parcels) == outcomes(HERE, work.square, parcels)
    assert outcomes(Processes(workers=3), work.square, []) == []


def test_this_process_does_where_nothing_speaks_against_it() -> None:
    assert on_this_machine(1) is HERE
    assert isinstance(on_this_machine(2), Processes)
    assert isinstance(on_this_machine(1, Limits(seconds=1.0)), Processes)


def test_workers_are_processes_of_one_thread_that_end_with_the_fleet(
    work: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    found = outcomes(Processes(workers=2), work.whose, list(range(6)))
    pids = {pid for pid, _ in found}
    assert os.getpid() not in pids
    assert len(pids) == 2
    assert {threads for _, threads in found} == {"1"}
    assert not multiprocessing.active_children()


def test_workers_are_replaced_after_some_tasks(work: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cell, "_TASKS", 2)
    pids = [pid for pid, _ in outcomes(Processes(workers=1), work.whose, list(range(5)))]
    assert pids[0] == pids[1] != pids[2] == pids[3] != pids[4]


@pytest.mark.slow
@linux
def test_what_meets_a_limit_or_crashes_is_lost_alone(work: Any) -> None:
    told: list[str] = []
    limits = Limits(seconds=5.0, memory=2 * 10**9)
    slow, large, crashed, fine = outcomes(
        Processes(workers=2, limits=limits, tell=told.append), work.hostile, [1, 2, 3, 0]
    )
    assert (slow.why, slow.under) == ("takes longer than 5 s, the limit of time", "5 s")
    assert large.why == "needs more memory than 2,000,000,000 bytes, the limit"
    assert "was killed by signal 11" in crashed.why
    assert fine == 0
    assert told == []
    assert [is_final({"lost": lost.under}, limits) for lost in (slow, large, crashed)] == [True, True, False]
    assert not is_final({"lost": slow.under}, Limits(seconds=6.0))
    assert is_final({}, limits)


def test_what_is_raised_by_the_work_is_raised_here_and_leaves_no_process(work: Any) -> None:
    with pytest.raises(OSError, match="not the fault of anybody here"):
        outcomes(Processes(workers=2), work.hostile, [0, 4, 1, 1])
    assert not multiprocessing.active_children()


def test_who_stops_listening_ends_the_processes(work: Any) -> None:
    rows = Processes(workers=2).do(work.slowly, list(range(20)))
    next(rows)
    begun = time.monotonic()
    rows.close()  # type: ignore[attr-defined]
    assert time.monotonic() - begun < 3.0
    assert not multiprocessing.active_children()


@posix
def test_fewer_processes_go_on_where_the_system_kills_one(work: Any, tmp_path: Path) -> None:
    told: list[str] = []
    parcels = [str(tmp_path / "mark"), "", "", ""]
    assert outcomes(Processes(workers=4, tell=told.append), work.killed_once, parcels) == parcels
    assert told == ["a worker process was killed, perhaps for want of memory; 2 go on"]


@posix
def test_a_task_whose_process_is_always_killed_is_lost_and_no_other(work: Any) -> None:
    lost, *fine = outcomes(Processes(workers=2), work.killed_always, [0, 1, 2])
    assert isinstance(lost, Lost)
    assert (lost.why, lost.under) == ("its process was killed by signal 9; perhaps it took too much memory", "")
    assert fine == [1, 2]


# --- rows -------------------------------------------------------------------------------------------------------------


def mourn(parcel: int, lost: Lost) -> dict[str, Any]:
    return {"x": parcel, "error": lost.why}


@posix
def test_every_row_is_on_disk_before_it_is_heard_of(work: Any, tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    with opened(path, {"x": (int,)}, "x", busy="", rows_of="", other="") as held:
        for row in finish(HERE, work.square, [3, 5], mourn, held):
            assert json.loads(path.read_text().splitlines()[-1]) == row == held.latest[row["x"]]
        lost = list(finish(Processes(workers=1), work.killed_always, [0], mourn, held))
    assert lost == [
        {"x": 0, "error": "its process was killed by signal 9; perhaps it took too much memory", "lost": ""}
    ]
    assert len(path.read_text().splitlines()) == 3


def test_of_rows_of_one_key_the_last_is_read_where_it_stands(tmp_path: Path) -> None:
    path, rows = tmp_path / "rows.jsonl", [{"x": k % 3, "n": k} for k in range(7)]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows) + '{"x": 1')
    with opened(path, {"x": (int,)}, "x", busy="", rows_of="", other="") as held:
        assert held.torn
        assert dict(held.latest) == {0: rows[6], 1: rows[4], 2: rows[5]}
        held.append({"x": 1, "n": 7})
        assert held.latest[1] == {"x": 1, "n": 7}
        assert held.latest.get(9) is None
    told = read_rows(path, {"x": (int,)}, rows_of="")
    assert list(told) == [*rows, {"x": 1, "n": 7}]
    assert told[-2:] == [rows[6], {"x": 1, "n": 7}]


def test_rows_that_nobody_keeps_leave_nothing_behind() -> None:
    with passing("x") as held:
        held.append({"x": "a", "n": 1})
        held.append({"x": "a", "n": 2})
        assert dict(held.latest) == {"a": {"x": "a", "n": 2}}
    assert not held.path.parent.exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"x": [1]}\n', r"is damaged: a row has a x that is \[1\]"),
        ('{"x": true}\n', "a row has a x that is True"),
        ('{"x": null}\n', "a row has a x that is None"),
        ('{"x": 1}}\n', "is damaged: Extra data"),
        ('{"x": ' + "9" * 5000 + "}\n", "is damaged: Exceeds the limit"),
        ('{"x": 1, "y": ' + "[" * 10**6 + "\n", "is damaged"),
        ('{"x": "' + "a" * 200, "a row takes more than 100 bytes"),
        ("\n", "holds no rows of tests"),
        ('{"y": 1}\n', "holds no rows of tests"),
        ("{}\n", "holds no rows of tests"),
    ],
)
def test_what_is_no_row_is_told(text: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if "takes more" in message:
        monkeypatch.setattr(journal, "LONGEST", 100)
    path = tmp_path / "rows.jsonl"
    path.write_text('{"x": 1}\n' + text)
    with (
        pytest.raises(InputError, match=message),
        opened(path, {"x": (int,)}, "x", busy="", rows_of="tests", other="another"),
    ):
        pass
    assert path.read_text() == '{"x": 1}\n' + text


@pytest.mark.slow
@pytest.mark.parametrize("name", ["t.csv", "t.parquet"])
def test_a_table_holds_few_of_its_rows(name: str, tmp_path: Path) -> None:
    from pyarrow.parquet import read_table

    rows = Rows(40_000, lambda k: {"file": f"f{k}", "planes": f"{k:01000d}", "n": k, "x": k / 3 if k % 7 else None})
    write_table(rows[:2], tmp_path / name)  # so that what pyarrow imports is not counted
    tracemalloc.start()
    write_table(rows, tmp_path / name)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 40_000 * 1000 / 2, most
    if name.endswith("csv"):
        with (tmp_path / name).open(newline="") as stream:
            read = [(row["file"], row["planes"], int(row["n"])) for row in csv.DictReader(stream)]
    else:
        read = [(row["file"], row["planes"], row["n"]) for row in read_table(tmp_path / name).to_pylist()]
    assert read == [(row["file"], row["planes"], row["n"]) for row in rows]


def test_numbers_and_names_that_a_column_cannot_hold_are_texts(tmp_path: Path) -> None:
    rows = [{"file": "a\udcff", "seed": 10**30, "x": 1.5}, {"file": "b", "seed": 1, "x": 2**60 + 1}]
    for name in ("t.csv", "t.parquet"):
        write_table(rows, tmp_path / name)
    from pyarrow.parquet import read_table

    assert read_table(tmp_path / "t.parquet").to_pylist() == [
        {"file": "a\\udcff", "seed": f"1{'0' * 30}", "x": 1.5},
        {"file": "b", "seed": "1", "x": 2.0**60},
    ]
    assert (tmp_path / "t.csv").read_text().splitlines()[1] == f"a\\udcff,1{'0' * 30},1.5"


def test_flat_rows_are_the_same_in_csv_and_parquet(tmp_path: Path) -> None:
    rows = [
        {"file": "a", "n": 1, "x": 1, "ok": True, "options": {"seed": 0, "at": [1, 2]}, "odd": 1},
        {"file": "b", "n": None, "x": 0.1 + 0.2, "ok": False, "options": {"seed": 1, "at": None}, "odd": "two"},
        {"file": "c", "error": 'a, "b"\nc'},
    ]
    told = [flat(row) for row in rows]
    assert list(told[0]) == ["file", "n", "x", "ok", "options.seed", "options.at", "odd"]
    for name in ("t.csv", "t.parquet", "again.parquet"):
        write_table(told, tmp_path / name)
    text = (tmp_path / "t.csv").read_text()
    assert text.splitlines()[1:3] == ['a,1,1,true,0,"[1, 2]",1,', "b,,0.30000000000000004,false,1,,two,"]
    assert (tmp_path / "t.parquet").read_bytes() == (tmp_path / "again.parquet").read_bytes()
    from pyarrow.parquet import read_table

    table = read_table(tmp_path / "t.parquet")
    assert [str(field.type) for field in table.schema] == [
        "string", "int64", "double", "bool", "int64", "string", "string", "string",
    ]  # fmt: skip
    assert table.to_pylist()[1] == told[1] | {"error": None}


# --- shards -----------------------------------------------------------------------------------------------------------


def parts(tasks: int, of: int, about: str = "x") -> dict[str, list[dict[str, Any]]]:
    """The rows of each shard, in any order."""
    whole, found = Whole.of(tasks, about), {}
    for number in range(1, of + 1):
        shard = Shard(number=number, of=of)
        rows = [{"file": f"f{i}", "i": i} | whole.mark(shard, i) for i in range(tasks) if shard.takes(i)]
        random.Random(number).shuffle(rows)
        found[f"p{number}"] = rows
    return found


@pytest.mark.parametrize(("tasks", "of"), [(1, 1), (10, 3), (16, 16), (3, 5)])
def test_shards_made_one_are_all_rows_in_order(tasks: int, of: int) -> None:
    assert list(merged(parts(tasks, of))) == [{"file": f"f{i}", "i": i} for i in range(tasks)]


def test_of_several_rows_of_a_task_in_one_part_the_last_counts() -> None:
    found = parts(4, 2)
    found["p1"].append(found["p1"][0] | {"i": 99})
    assert sum(row["i"] == 99 for row in merged(found)) == 1


def test_a_task_of_several_rows_is_whole_with_all_of_them() -> None:
    whole, shard = Whole.of(2, "x"), Shard(number=1, of=1)

    def rows(index: int, pieces: int, i: int) -> list[dict[str, Any]]:
        return [{"i": i + k, "part": piece(whole.mark(shard, index)["part"], k, pieces)} for k in range(pieces)]

    single = {"i": 9} | whole.mark(shard, 0)
    assert list(merged({"p": [*rows(1, 3, 20)[::-1], single]})) == [{"i": 9}, {"i": 20}, {"i": 21}, {"i": 22}]
    # Done again, when the file held two.
    assert list(merged({"p": [*rows(1, 3, 20), single, *rows(1, 2, 30)]})) == [{"i": 9}, {"i": 30}, {"i": 31}]
    with pytest.raises(InputError, match="shard 1/1 is not complete: 1 of its 2 tasks"):
        merged({"p": [single, *rows(1, 3, 20)[1:]]})
    with pytest.raises(InputError, match="p: is damaged"):
        merged({"p": [{"part": piece(whole.mark(shard, 0)["part"], 3, 3)}]})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: {"p1": p["p1"], "p3": p["p3"]}, "shard 2/3 is not complete: 3 of its 3 tasks"),
        (lambda p: p | {"p2": p["p2"][1:]}, "shard 2/3 is not complete: 1 of its 3 tasks"),
        (lambda p: p | {"again": p["p2"]}, "again: has rows of shard 2/3, and so has p2"),
        (lambda p: p | {"p2": parts(10, 3, "y")["p2"]}, "p2: is part of another fleet"),
        (lambda p: p | {"p2": parts(9, 3)["p2"]}, "p2: is part of another fleet"),
        (lambda p: p | {"p2": parts(10, 2)["p2"]}, "p2: is part of another fleet"),
        (lambda p: p | {"p2": [{"file": "f1"}]}, "p2: holds rows of no shard"),
        (
            lambda p: p | {"p2": [{"file": "f1", "part": p["p2"][0]["part"] | {"shard": "1/0"}}]},
            "p2: is damaged: .*1/0",
        ),
        (lambda p: p | {"p2": [{"file": "f1", "part": p["p2"][0]["part"] | {"index": 0}}]}, "p2: is damaged"),
        (lambda p: p | {"p2": [{"file": "f1", "part": 7}]}, "p2: is damaged: .* 7"),
        (
            lambda p: {"p1": [{"file": "f", "part": p["p1"][0]["part"] | {"index": 0, "shard": f"1/{10**15}"}}]},
            "p1: is damaged",
        ),
        (
            lambda p: {"p1": [{"file": "f", "part": p["p1"][0]["part"] | {"index": 0, "tasks": 10**15}}]},
            "shard 1/3 is not complete",
        ),
        (lambda _: {"p1": []}, "p1: holds no rows"),
    ],
)
def test_parts_that_do_not_make_a_whole_are_refused(change: Callable[[Any], Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        merged(change(parts(10, 3)))
    assert "\n" not in str(caught.value)


# --- Dask -------------------------------------------------------------------------------------------------------------


def test_a_cluster_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for address in ("10.0.0.1", "tcp://nowhere", "lokal"):
        with pytest.raises(InputError, match="is no address of a Dask scheduler"):
            next(iter(Dask(address=address).do(abs, [1])))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r'pip install "symrefine\[dask\]"'):
        next(iter(Dask(address="local").do(abs, [1])))


@pytest.fixture
def cluster(work: Any) -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    assert work
    with Cluster(3) as started:
        yield started


@pytest.mark.slow
@posix
def test_a_cluster_survives_the_death_of_a_worker_and_of_its_scheduler(
    work: Any, cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # its workers are somewhere else
    told: list[str] = []
    parcels = list(range(45))
    rows: dict[int, Any] = {}
    for index, row in Dask(address=cluster.address, tell=told.append).do(work.slowly, parcels):
        assert index not in rows
        rows[index] = row
        if len(rows) == 10:
            cluster.kill_worker()
        if len(rows) == 25:
            cluster.restart()
    assert [rows[index] for index in parcels] == outcomes(HERE, work.square, parcels)
    assert any("connecting to the scheduler anew" in text for text in told)
    assert outcomes(Dask(address=cluster.address), work.folder, [0]) == [str(tmp_path)]


@pytest.mark.slow
@linux
def test_limits_hold_on_a_cluster_and_crashes_end_no_worker(work: Any) -> None:
    pytest.importorskip("distributed")
    limits = Limits(seconds=5.0, memory=2 * 10**9)
    here = outcomes(Processes(workers=1, limits=limits), work.hostile, [1, 2, 3, 0])
    assert outcomes(Dask(address="local", workers=2, limits=limits), work.hostile, [1, 2, 3, 0]) == here
    with pytest.raises(OSError, match="not the fault"):
        outcomes(Dask(address="local"), work.hostile, [4])
