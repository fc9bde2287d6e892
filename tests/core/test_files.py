import errno
import io
import multiprocessing
import os
import pickle
import re
import zipfile

import numpy as np
import pytest
from sources import SOURCES

from semrl.core.arrays import digest, json_to_array
from semrl.core.errors import SemrlError
from semrl.core.files import read_arrays, write_arrays, write_atomic, write_text

ARRAYS = {
    "a/weights": np.arange(30, dtype=np.float32).reshape(5, 6),
    "a/empty": np.zeros((0, 3)),
    "b/number": np.array(7),
    "meta": json_to_array({"format": 1}),
}


class Trap:
    """Leaves a mark when it is unpickled."""

    path = ""

    def __reduce__(self):
        return (open, (self.path, "w"))


def test_arrays_come_back_bit_for_bit(tmp_path):
    write_arrays(tmp_path / "x.npz", ARRAYS)
    back = read_arrays(tmp_path / "x.npz")
    assert digest(back) == digest(ARRAYS)
    assert [path.name for path in tmp_path.iterdir()] == ["x.npz"]


def test_what_was_read_owns_its_memory_so_that_nobody_need_copy_it(tmp_path):
    arrays = ARRAYS | {"columns": np.asfortranarray(ARRAYS["a/weights"])}
    write_arrays(tmp_path / "x.npz", arrays)
    read = read_arrays(tmp_path / "x.npz")
    assert read["a/weights"].flags.owndata and read["a/weights"].flags.writeable
    assert digest(read) == digest(arrays)


def test_only_what_is_asked_for_is_read(tmp_path):
    write_arrays(tmp_path / "x.npz", ARRAYS)
    assert read_arrays(tmp_path / "x.npz", prefixes=("b/", "meta")).keys() == {"b/number", "meta"}


def test_every_flipped_byte_is_found_or_means_nothing(tmp_path):
    path = tmp_path / "x.npz"
    write_arrays(path, ARRAYS)
    whole = path.read_bytes()
    found = 0
    for i in range(len(whole)):
        path.write_bytes(whole[:i] + bytes([whole[i] ^ 0x15]) + whole[i + 1 :])
        try:
            back = read_arrays(path)
        except SemrlError as error:
            assert "x.npz is damaged" in str(error) and "\n" not in str(error)
            found += 1
            continue
        assert all(digest({"": back[name]}) == digest({"": ARRAYS[name]}) for name in back if name in ARRAYS)
    assert found > len(whole) / 2


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9, 0.999])
def test_truncated_files_are_refused(tmp_path, share):
    path = tmp_path / "x.npz"
    write_arrays(path, ARRAYS)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(SemrlError, match="damaged"):
        read_arrays(path)


def test_a_pickled_object_is_never_loaded(tmp_path):
    trap = Trap()
    trap.path = str(tmp_path / "sprung")
    objects = np.empty(1, dtype=object)
    objects[0] = trap
    inside = io.BytesIO()
    np.lib.format.write_array(inside, objects, allow_pickle=True)
    path = tmp_path / "x.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("meta.npy", inside.getvalue())
    with pytest.raises(SemrlError, match="damaged"):
        read_arrays(path)
    path.write_bytes(pickle.dumps(trap))
    with pytest.raises(SemrlError, match="damaged"):
        read_arrays(path)
    assert not (tmp_path / "sprung").exists()
    with pytest.raises(ValueError, match=r"[Oo]bject"):
        write_arrays(path, {"trap": objects})


def test_missing_files_are_named(tmp_path):
    with pytest.raises(SemrlError, match=r"none\.npz does not exist"):
        read_arrays(tmp_path / "none.npz")


def test_what_fails_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "x.txt"
    write_text(path, "old")

    def full(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(SemrlError, match=r"cannot write .*x\.txt: No space left on device"):
            write_text(path, "new")
    for error in (KeyboardInterrupt, MemoryError):
        with pytest.raises(error):
            write_atomic(path, lambda _, error=error: (_ for _ in ()).throw(error()))
    assert path.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["x.txt"]


def test_two_who_write_one_file_do_not_mix(tmp_path):
    path = tmp_path / "x.txt"

    def write_beside_another(file):
        file.write(b"ours")
        other = multiprocessing.get_context("spawn").Process(target=write_text, args=(path, "of the other"))
        other.start()
        other.join()
        assert path.read_text() == "of the other"

    write_atomic(path, write_beside_another)
    assert path.read_text() == "ours"
    assert [path.name for path in tmp_path.iterdir()] == ["x.txt"]


def test_a_disk_that_fills_in_the_middle_of_an_array(tmp_path):
    resource = pytest.importorskip("resource")
    path = tmp_path / "x.npz"
    write_arrays(path, ARRAYS)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, before[1]))  # the kernel refuses every byte beyond
    try:
        with pytest.raises(SemrlError, match="cannot write"):
            write_arrays(path, {"much": np.ones((8, 1 << 18))})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert digest(read_arrays(path)) == digest(ARRAYS)
    assert [path.name for path in tmp_path.iterdir()] == ["x.npz"]


def test_places_that_cannot_be_written_are_named(tmp_path):
    with pytest.raises(SemrlError, match="cannot write"):
        write_text(tmp_path / "nowhere" / "x.txt", "new")


@pytest.mark.parametrize("text", ["plain", "Ω → é", "a file named \udcff\udcfe"])
def test_texts_are_utf_8_whatever_files_are_called(tmp_path, text):
    write_text(tmp_path / "text", text)
    assert (tmp_path / "text").read_bytes().decode("utf-8") == text.replace("\udcff\udcfe", "??")


def test_no_text_is_read_in_the_encoding_of_the_locale():
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"\.(read_text\(\)|open\(\"a\", newline=\"\"\))", text), path
