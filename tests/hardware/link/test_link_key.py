"""Keys: of the right size, for nobody else to read, never replaced by accident."""

import stat

import pytest

from hardware.link.link_key import (
    KEY_VARIABLE,
    LinkKeyError,
    is_authentic,
    mac,
    new_key,
    read_key,
    take_key,
    write_key,
)


def test_a_key_is_read_as_written_and_only_its_owner_may(tmp_path):
    file, key = tmp_path / "robots" / "ames.key", new_key()
    write_key(file, key)
    assert read_key(file) == key
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700


def test_keys_differ():
    assert len({new_key() for _ in range(20)}) == 20


def test_a_key_is_not_replaced_unless_that_is_meant(tmp_path):
    file, first, second = tmp_path / "ames.key", new_key(), new_key()
    write_key(file, first)
    with pytest.raises(LinkKeyError, match="--force"):
        write_key(file, second)
    assert read_key(file) == first
    write_key(file, second, force=True)
    assert read_key(file) == second


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660, 0o610, 0o644])
def test_a_key_that_others_may_read_is_refused(tmp_path, mode):
    file = tmp_path / "ames.key"
    write_key(file, new_key())
    file.chmod(mode)
    with pytest.raises(LinkKeyError, match="0600"):
        read_key(file)


@pytest.mark.parametrize("text", ["", "00" * 15, "00" * 17, "g" * 32, "0x" + "00" * 15])
def test_what_is_no_key_is_refused(tmp_path, text):
    file = tmp_path / "ames.key"
    file.write_text(text)
    file.chmod(0o600)
    with pytest.raises(LinkKeyError, match="32 hexadecimal"):
        read_key(file)
    with pytest.raises(LinkKeyError, match=KEY_VARIABLE):
        take_key({KEY_VARIABLE: text})


def test_a_key_taken_from_the_environment_is_in_it_no_more():
    key = new_key()
    environment = {KEY_VARIABLE: key.hex(), "HOME": "/"}
    assert take_key(environment) == key
    assert environment == {"HOME": "/"}
    with pytest.raises(LinkKeyError):
        take_key(environment)


def test_a_code_fits_its_own_words_and_key_only():
    key, other = new_key(), new_key()
    code = mac(key, b"words")
    assert is_authentic(key, b"words", code)
    assert not is_authentic(key, b"Words", code)
    assert not is_authentic(other, b"words", code)
