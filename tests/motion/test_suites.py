"""Suites: folders, patterns and lists; labels of the motions; pairs of components."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from slipsweep import InputError, Pair, Record, Suite, read_record, read_suite, sweep
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


def test_suites_of_the_same_motions_are_equal(folder: Path) -> None:
    suite = read_suite(folder)
    sent = pickle.loads(pickle.dumps(suite))
    assert sent == suite == read_suite(folder)
    assert hash(sent) == hash(suite)


def test_suites_of_other_motions_differ(folder: Path) -> None:
    suite = read_suite(folder)
    assert suite != suite[:2]
    changed = read_record(folder / "a.csv").corrected("mean")
    assert suite != Suite((changed, *suite.motions[1:]), suite.labels, suite.name)


def test_a_part_of_a_suite_is_taken_by_labels_numbers_or_a_slice(folder: Path) -> None:
    suite = read_suite(folder)
    assert suite[:2] == suite[["a", "b"]] == suite[[0, 1]]
    assert suite[:2].labels == ("a", "b")


def test_a_suite_prints_its_name_and_labels(folder: Path) -> None:
    assert repr(read_suite(folder)[:2]) == f"Suite({str(folder)!r}: 2 motions: a, b)"


def test_a_long_suite_prints_its_first_and_last_labels() -> None:
    assert "8 motions: 0, 1, 2, ..., 6, 7" in repr(Suite((noise(1),) * 8, tuple("01234567")))


def test_a_suite_that_was_sent_to_a_worker_gives_the_same_displacements(folder: Path) -> None:
    suite = read_suite(folder)
    results = [
        sweep(5.0, 0.1, scale=3.0, excitation=motions)
        for motions in (suite, pickle.loads(pickle.dumps(suite)))
    ]
    xr.testing.assert_identical(*results)
    assert (results[0].permanent_displacement > 0.0).any()


def test_measures_along_the_motions(folder: Path) -> None:
    suite = read_suite(folder)
    assert suite.measures["motion_file"].tolist() == ["a.csv", "b.csv", "c.csv"]
    np.testing.assert_allclose(suite.measures["motion_interval"], [0.02, 0.03, 0.01], rtol=1e-14)
    for at, record in enumerate(suite.components):
        for name, value in measures_by_sums(record.times, record.acceleration).items():
            measure = suite.measures[f"motion_{name}"][at]
            assert measure == pytest.approx(value, rel=1e-4, nan_ok=True), name


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
    for quarter, sign, component in (
        (0, 1, first),
        (1, 1, second),
        (2, -1, first),
        (3, -1, second),
        (4, 1, first),
    ):
        np.testing.assert_array_equal(
            pair.rotated(90.0 * quarter).acceleration, sign * component.acceleration
        )
    # what stands at right angles has the rest of the energy
    whole = sum(
        arias_intensity(component.times, component.acceleration) for component in (first, second)
    )
    for azimuth in (10.0, 33.3, 77.0):
        both = (pair.rotated(azimuth), pair.rotated(azimuth + 90.0))
        assert sum(
            arias_intensity(component.times, component.acceleration) for component in both
        ) == pytest.approx(whole, rel=1e-13)
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


# ------------------------------------------------------------------------------ vertical components


def test_a_suite_of_vertical_components_only_is_refused(folder: Path) -> None:
    up = write(folder / "a_UP.csv")
    with pytest.raises(InputError, match=r"vertical components only: a_UP\.csv \(UP\); vertical ="):
        read_suite([up])


def test_a_vertical_component_in_a_pair_is_refused(folder: Path) -> None:
    up = write(folder / "a_UP.csv")
    with pytest.raises(InputError, match=r"vertical components in pairs: a_UP\.csv \(UP\)"):
        read_suite([(folder / "a.csv", up)])


def test_another_choice_of_vertical_components_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="vertical = 'no': must be one of 'leave_out', 'accept'"):
        read_suite(folder, vertical="no")  # type: ignore[arg-type]


def test_a_vertical_record_that_was_read_by_itself_is_accepted(folder: Path) -> None:
    record = read_record(write(folder / "a_UP.csv"))
    assert read_suite([record]).motions == (record,)


def test_a_vertical_channel_is_left_out(tmp_path: Path) -> None:
    """Files of three components whose second is vertical in one of them."""
    for name, heading in (("one", "NS,EW,UD"), ("two", "NS,UD,EW")):
        rows = "".join(f"{at % 3},{at % 5},{at % 7}\n" for at in range(12))
        (tmp_path / f"{name}.csv").write_text(f"dt = 0.01\nunits: gal\n{heading}\n{rows}")
    suite = read_suite(tmp_path, channel=2, implausible="accept")
    assert suite.labels == ("one",)
    assert suite.left_out == ("two.csv (UD)",)


@pytest.fixture
def pairs(tmp_path: Path) -> Path:
    """Two motions of two components, by the endings of their names."""
    for name in ("one_NS", "one_EW", "two_NS", "two_EW"):
        values = np.random.default_rng(len(name)).normal(size=5) + ("two" in name)
        write(tmp_path / f"{name}.csv", values)
    return tmp_path


def test_pairs_are_told_by_the_endings_of_their_names(pairs: Path) -> None:
    suite = read_suite(pairs, pairs=("_NS", "_EW"))
    assert suite.has_pairs
    assert suite.labels == ("one", "two")
    expected = Pair(read_record(pairs / "two_NS.csv"), read_record(pairs / "two_EW.csv"))
    assert suite["two"] == expected
    files = ["one_NS.csv one_EW.csv", "two_NS.csv two_EW.csv"]
    assert suite.measures["motion_file"].tolist() == files


def test_pairs_are_listed(pairs: Path) -> None:
    paths = [[pairs / f"{name}_NS.csv", pairs / f"{name}_EW.csv"] for name in ("one", "two")]
    assert read_suite(paths).motions == read_suite(pairs, pairs=("_NS", "_EW")).motions


def test_vertical_components_beside_pairs_are_left_out(pairs: Path) -> None:
    expected = read_suite(pairs, pairs=("_NS", "_EW")).motions
    write(pairs / "one_UD.csv")
    assert read_suite(pairs, pairs=("_NS", "_EW")).motions == expected


def test_components_without_the_other_are_refused(pairs: Path) -> None:
    write(pairs / "three_NS.csv")
    write(pairs / "single.csv")
    message = r"without the other component: single\.csv, three_NS\.csv"
    with pytest.raises(InputError, match=message):
        read_suite(pairs, pairs=("_NS", "_EW"))


@pytest.mark.parametrize("endings", ["_NS", ("_NS",), ("_NS", ""), ("_NS", "_NS"), (1, 2)])
def test_endings_that_are_no_two_texts_are_refused(pairs: Path, endings: Any) -> None:
    with pytest.raises(InputError, match=r"^pairs = "):
        read_suite(pairs, pairs=endings)


AT2 = """PEER
A place, 1/1/2000, A station, {}
ACCELERATION IN UNITS OF G
NPTS= 3, DT= .01
0 .1 0
"""


@pytest.fixture
def with_verticals(folder: Path) -> Path:
    """The folder with two vertical components by their headers, of which one also by its name."""
    (folder / "e.AT2").write_text(AT2.format("VERT"))
    (folder / "RSN1_A-UP.AT2").write_text(AT2.format("UP"))
    return folder


@pytest.mark.parametrize("kind", ["folder", "pattern", "list"])
def test_vertical_components_are_left_out_and_named(with_verticals: Path, kind: str) -> None:
    """By their headers or by their names, which need not be read."""
    (with_verticals / "z.UD").write_text("damaged\n")
    paths: dict[str, Any] = {
        "folder": with_verticals,
        "pattern": f"{with_verticals}/*",
        "list": sorted(with_verticals.iterdir()),
    }
    suite = read_suite(paths[kind])
    assert suite.labels == ("a", "b", "c")
    names = "RSN1_A-UP.AT2 (UP), e.AT2 (VERT), z.UD (UD)"
    assert ", ".join(suite.left_out) == suite.attrs["left_out_vertical"] == names
    assert f"; left out: {names})" in repr(suite)
    left_out = f"left out, vertical components: {names}; vertical = 'accept' takes them"
    assert suite.summary().endswith(left_out)


def test_vertical_components_are_accepted_with_a_caution(with_verticals: Path) -> None:
    suite = read_suite(with_verticals, vertical="accept")
    assert suite.labels == ("RSN1_A-UP", "a", "b", "c", "e")
    assert suite.left_out == ()
    assert suite["e"].attrs["record_caution"] == "vertical component (VERT)"
    assert suite.cautions() == [
        f"caution: {with_verticals / 'RSN1_A-UP.AT2'}: vertical component (UP)",
        f"caution: {with_verticals / 'e.AT2'}: vertical component (VERT)",
    ]


def test_an_accepted_vertical_component_has_to_be_read(folder: Path) -> None:
    (folder / "z.UD").write_text("damaged\n")
    with pytest.raises(InputError, match=r"1 of 4 files cannot be read: z\.UD"):
        read_suite(folder, vertical="accept")
