"""Suites: folders, patterns and lists; labels of the motions; pairs of components."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slipsweep import InputError, Pair, Record, Suite, read_record, read_suite
from slipsweep.motion.cutting import path_of_record
from slipsweep.motion.intensity import arias_intensity
from tests.support.intensity import measures_by_sums

HEADER = "time (s),acceleration (m/s2)\n"


def write(path: Path, values: Any = (0.0, 1.0, -2.0, 0.5), interval: float = 0.1) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        HEADER + "".join(f"{at * interval:.6g},{value:.6g}\n" for at, value in enumerate(values))
    )
    return path


def noise(seed: int, count: int = 50, interval: float = 0.01) -> Record:
    return Record.sampled(
        np.random.default_rng(seed).normal(size=count), interval, f"noise{seed}.csv"
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for at, name in enumerate(("c.csv", "a.csv", "b.csv"), 1):
        write(tmp_path / "motions" / name, np.arange(at + 3) % 3 - 1.0, 0.01 * at)
    return tmp_path / "motions"


def test_a_folder_a_pattern_and_a_list_are_one_suite(folder: Path) -> None:
    suites = [
        read_suite(folder),
        read_suite(f"{folder}/*.csv"),
        read_suite(f"{folder.parent}/**/*.csv"),
        read_suite([folder / f"{name}.csv" for name in "abc"]),
        read_suite([folder / "a.csv", f"{folder}/[bc].csv", folder]),  # each file once
        read_suite(read_record(folder / f"{name}.csv") for name in "abc"),
    ]
    for suite in suites:
        assert suite.labels == ("a", "b", "c")
        assert suite.motions == suites[0].motions
        assert [motion.times.size for motion in suite] == [5, 6, 4]
    np.testing.assert_array_equal(
        suites[0]["b"].acceleration, read_record(folder / "b.csv").acceleration
    )


def test_all_damaged_files_are_named_at_once(folder: Path) -> None:
    (folder / "damaged.AT2").write_text("NPTS= 3, DT= 0.01\n1 2\n")
    (folder / "notes.txt").write_text("what is in this folder\n")
    (folder / "b.csv").write_text(f"{HEADER}0,1\n0.1,zero\n")
    with pytest.raises(
        InputError, match=r"^3 of 5 files cannot be read: b\.csv, damaged\.AT2, notes\.txt"
    ) as caught:
        read_suite(folder)
    b, damaged, notes = caught.value.__notes__
    assert b == f"{folder / 'b.csv'}: line 3: '0.1,zero': must be a time and an acceleration"
    assert damaged.startswith(f"{folder / 'damaged.AT2'}: 2 accelerations, where its header says 3")
    assert notes.startswith(f"{folder / 'notes.txt'}: ")


def test_stems_that_are_alike_are_told_apart(tmp_path: Path) -> None:
    paths = [
        write(tmp_path / name) for name in ("x/a.csv", "y/a.csv", "y/b.csv", "y/b.txt", "c.csv")
    ]
    assert read_suite(paths).labels == ("x/a.csv", "y/a.csv", "y/b.csv", "y/b.txt", "c")
    assert Suite((noise(1), noise(1), noise(2))).labels == (
        "noise1.csv",
        "noise1.csv (2)",
        "noise2",
    )


def test_motions_that_are_the_same_are_told(folder: Path) -> None:
    (folder / "d.csv").write_text(
        (folder / "b.csv").read_text() + "\n"
    )  # another file, the same motion
    suite = read_suite(folder)
    assert suite.attrs["duplicate_motions"] == "b, d"
    assert "duplicate_motions" not in suite[["a", "b"]].attrs


def test_a_suite_is_compared_by_what_is_in_it(folder: Path) -> None:
    one = read_suite(folder)
    sent = pickle.loads(pickle.dumps(one))
    assert sent == one == read_suite(folder)
    assert hash(sent) == hash(one)
    # a worker gets it with every chunk, and makes the tables of its records once
    assert path_of_record(sent.components[0], 1.0) is path_of_record(one.components[0], 1.0)
    assert one != one[:2]
    assert one[:2] == one[["a", "b"]] == one[[0, 1]]
    changed = read_record(folder / "a.csv").corrected("mean")
    assert one != Suite((changed, *one.motions[1:]), one.labels, one.name)
    assert repr(one[:2]) == f"Suite({str(folder)!r}: 2 motions: a, b)"
    assert "8 motions: 0, 1, 2, ..., 6, 7" in repr(Suite((noise(1),) * 8, tuple("01234567")))


def test_measures_along_the_motions(folder: Path) -> None:
    suite = read_suite(folder)
    assert suite.measures["motion_file"].tolist() == ["a.csv", "b.csv", "c.csv"]
    np.testing.assert_allclose(suite.measures["motion_interval"], [0.02, 0.03, 0.01], rtol=1e-14)
    for at, record in enumerate(suite.components):
        for name, value in measures_by_sums(record.times, record.acceleration).items():
            found = suite.measures[f"motion_{name}"][at]
            assert found == pytest.approx(value, rel=1e-4, nan_ok=True), name


@pytest.mark.parametrize(
    ("motions", "labels", "words"),
    [
        ((), (), "motions: 0: must be one at least"),
        ((noise(1), "b"), (), r"motions\[2\] = 'b': must be a Record"),
        ((noise(1), Pair(noise(1), noise(2))), (), "all Records or all Pairs"),
        ((noise(1), noise(2)), ("a",), "^labels = "),
        ((noise(1), noise(2)), ("a", "a"), "^labels = "),
        ((noise(1), noise(2)), ("a", "\n"), "^labels = .* that can be printed"),
        ((noise(1), noise(2)), ("a", 2), "^labels = .* 2 different texts"),
    ],
)
def test_suites_without_motions_or_with_wrong_labels_are_refused(
    motions: Any, labels: Any, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        Suite(motions, labels)
    with pytest.raises(
        InputError, match=r"motion = 'noise3': not in the suite; did you mean \"noise"
    ):
        Suite((noise(1), noise(2)))["noise3"]


@pytest.mark.parametrize(
    ("paths", "words"),
    [
        ("none/*.csv", r"none/\*\.csv: no file fits this pattern"),
        ("none.csv", r"1 of 1 files cannot be read: none\.csv"),
        ([], r"paths = \[\]: must name one motion at least"),
        (3, "paths = 3: must be a list of files"),
        ([("a.csv", "b.csv", "c.csv")], "pairs of files"),
        ("empty", "a folder without files"),
        ("\0", "cannot be read"),
    ],
)
def test_paths_that_name_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, paths: Any, words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=words):
        read_suite(paths)


# ----------------------------------------------------------------------------------------- pairs


def test_a_rotation_is_exact_at_the_quarters_and_straight_between_samples() -> None:
    first = noise(1)
    second = noise(2)
    pair = Pair(first, second)
    for quarter, sign, one in (
        (0, 1, first),
        (1, 1, second),
        (2, -1, first),
        (3, -1, second),
        (4, 1, first),
    ):
        np.testing.assert_array_equal(
            pair.rotated(90.0 * quarter).acceleration, sign * one.acceleration
        )
    # what stands at right angles has the rest of the energy
    whole = sum(arias_intensity(one.times, one.acceleration) for one in (first, second))
    for azimuth in (10.0, 33.3, 77.0):
        both = (pair.rotated(azimuth), pair.rotated(azimuth + 90.0))
        assert sum(arias_intensity(one.times, one.acceleration) for one in both) == pytest.approx(
            whole, rel=1e-13
        )
        assert both[0] == Pair(first, second).rotated(azimuth)


def test_the_shorter_component_is_continued_with_zeros() -> None:
    first = noise(1, 50)
    second = noise(2, 40)
    pair = Pair(first, second)
    np.testing.assert_array_equal(
        pair.rotated(90.0).acceleration, [*second.acceleration, *np.zeros(10)]
    )
    np.testing.assert_array_equal(Pair(second, first).rotated(90.0).times, first.times)
    with pytest.raises(InputError, match=r"noise1\.csv, noise2\.csv: .* sampled at the same times"):
        Pair(first, noise(2, 50, 0.02))


def test_pairs_by_the_endings_of_their_names(tmp_path: Path) -> None:
    for name in ("one_NS", "one_EW", "two_NS", "two_EW"):
        write(
            tmp_path / f"{name}.csv",
            np.random.default_rng(len(name)).normal(size=5) + ("two" in name),
        )
    suite = read_suite(tmp_path, pairs=("_NS", "_EW"))
    assert suite.labels == ("one", "two")
    assert suite.has_pairs
    assert suite["two"] == Pair(
        read_record(tmp_path / "two_NS.csv"), read_record(tmp_path / "two_EW.csv")
    )
    listed = read_suite(
        [[tmp_path / f"{name}_NS.csv", tmp_path / f"{name}_EW.csv"] for name in ("one", "two")]
    )
    assert listed.motions == suite.motions
    assert suite.measures["motion_file"].tolist() == [
        "one_NS.csv one_EW.csv",
        "two_NS.csv two_EW.csv",
    ]
    write(tmp_path / "one_UD.csv")
    assert read_suite(tmp_path, pairs=("_NS", "_EW")).motions == suite.motions
    write(tmp_path / "three_NS.csv")
    write(tmp_path / "single.csv")
    with pytest.raises(
        InputError, match=r"without the other component: single\.csv, three_NS\.csv"
    ):
        read_suite(tmp_path, pairs=("_NS", "_EW"))
    for pairs in ("_NS", ("_NS",), ("_NS", ""), ("_NS", "_NS"), (1, 2)):
        with pytest.raises(InputError, match=r"^pairs = "):
            read_suite(tmp_path, pairs=pairs)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------ vertical components


def test_vertical_components_are_left_out_and_named(folder: Path) -> None:
    """By their names, which need not be read, and by their headers; an explicit word takes them."""
    expected = read_suite(folder)
    header = "PEER\nA place, 1/1/2000, A station, {}\nACCELERATION IN UNITS OF G\n"
    at2 = f"{header}NPTS= 3, DT= .01\n0 .1 0\n"
    (folder / "e.AT2").write_text(at2.format("VERT"))
    (folder / "RSN1_A-UP.AT2").write_text(at2.format("UP"))
    (folder / "z.UD").write_text("damaged\n")
    for paths in (folder, f"{folder}/*", sorted(folder.iterdir())):
        suite = read_suite(paths)
        assert suite.motions == expected.motions
        assert suite.left_out == ("RSN1_A-UP.AT2 (UP)", "e.AT2 (VERT)", "z.UD (UD)")
        assert "; left out: RSN1_A-UP.AT2 (UP), e.AT2 (VERT), z.UD (UD))" in repr(suite)
        assert suite.summary().endswith(
            "left out, vertical components: RSN1_A-UP.AT2 (UP), e.AT2 (VERT), z.UD (UD); "
            "vertical = 'accept' takes them"
        )
        assert suite.attrs["left_out_vertical"] == ", ".join(suite.left_out)
    with pytest.raises(InputError, match=r"1 of 6 files cannot be read: z\.UD"):
        read_suite(folder, vertical="accept")
    (folder / "z.UD").unlink()
    accepted = read_suite(folder, vertical="accept")
    assert accepted.labels == ("RSN1_A-UP", "a", "b", "c", "e")
    assert accepted.left_out == ()
    assert accepted["e"].attrs["record_caution"] == "vertical component (VERT)"
    assert accepted.cautions() == [
        f"caution: {folder / 'RSN1_A-UP.AT2'}: vertical component (UP)",
        f"caution: {folder / 'e.AT2'}: vertical component (VERT)",
    ]


def test_what_a_suite_of_vertical_components_says(folder: Path) -> None:
    up = write(folder / "a_UP.csv")
    with pytest.raises(
        InputError, match=r"vertical components only: a_UP\.csv \(UP\); vertical = "
    ):
        read_suite([up])
    with pytest.raises(InputError, match=r"vertical components in pairs: a_UP\.csv \(UP\)"):
        read_suite([(folder / "a.csv", up)])
    with pytest.raises(InputError, match="vertical = 'no': must be one of 'leave_out', 'accept'"):
        read_suite(folder, vertical="no")  # type: ignore[arg-type]
    record = read_record(up)
    assert read_suite([record]).motions == (record,)  # a Record was chosen by its reader


def test_a_vertical_channel_is_left_out(tmp_path: Path) -> None:
    """Files of three components whose second is vertical in one of them."""
    for name, heading in (("one", "NS,EW,UD"), ("two", "NS,UD,EW")):
        rows = "".join(f"{at % 3},{at % 5},{at % 7}\n" for at in range(12))
        (tmp_path / f"{name}.csv").write_text(f"dt = 0.01\nunits: gal\n{heading}\n{rows}")
    suite = read_suite(tmp_path, channel=2, implausible="accept")
    assert suite.labels == ("one",)
    assert suite.left_out == ("two.csv (UD)",)
