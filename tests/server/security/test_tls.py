"""Certificates: made for this machine, renewed in time, keys for nobody else."""

from __future__ import annotations

import contextlib
import datetime
import shutil
import socket
import ssl
import subprocess
import threading

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID
from hypothesis import given
from hypothesis import strategies as st

from server.common import clock
from server.security import tls
from server.security.tls import AUTHORITY_DAYS, LEAF_DAYS, certificate, own_addresses, own_names
from server.security.tls_limits import PRIVATE, authority_limits, is_permitted

MAX_DAYS = 825
"""Longer ones are refused by iOS."""


def load(path):
    return x509.load_pem_x509_certificate(path.read_bytes())


def names_of(leaf):
    extension = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    return {str(name.value) for name in extension.value}


def test_the_certificate_is_what_phones_accept(tmp_path):
    made = certificate(tmp_path)
    leaf, authority = load(made.cert), load(made.authority)
    leaf.verify_directly_issued_by(authority)
    lifetime = leaf.not_valid_after_utc - leaf.not_valid_before_utc
    assert lifetime.days <= LEAF_DAYS + 1 <= MAX_DAYS
    usage = leaf.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    assert list(usage) == [ExtendedKeyUsageOID.SERVER_AUTH]
    assert isinstance(leaf.public_key().curve, ec.SECP256R1)
    assert not leaf.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    constraints = authority.extensions.get_extension_for_class(x509.BasicConstraints)
    assert constraints.critical
    assert constraints.value.path_length == 0


def test_it_names_every_address_and_the_names_of_the_settings(tmp_path):
    made = certificate(tmp_path, ["robot.lab"])
    assert names_of(load(made.cert)) == {*own_names(), "robot.lab"}


def test_servers_that_start_at_once_have_one_authority_and_certificates_of_their_own(tmp_path):
    owns = [tmp_path / "servers" / name for name in ("left", "right", "middle", "other")]
    made = []

    def start(own):
        made.append(certificate(tmp_path, ["robots.lab"], own))

    threads = [threading.Thread(target=start, args=(own,)) for own in owns]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {one.authority for one in made} == {tmp_path / "ca.pem"}
    assert {one.cert.parent for one in made} == set(owns)
    for one in made:
        load(one.cert).verify_directly_issued_by(load(one.authority))
    serials = {load(one.cert).serial_number for one in made}
    assert len(serials) == len(owns)
    assert load(certificate(tmp_path, ["robots.lab"], owns[0]).cert).serial_number in serials


def test_keys_are_for_nobody_else(tmp_path):
    state = tmp_path / "state"
    made = certificate(state)
    assert len(list(state.glob("*key*"))) == 2
    assert {path.stat().st_mode & 0o777 for path in state.iterdir()} == {0o600}
    assert state.stat().st_mode & 0o777 == 0o700
    assert b"PRIVATE" not in made.authority.read_bytes()
    assert b"PRIVATE" not in made.cert.read_bytes()


def test_a_good_one_is_kept(tmp_path):
    first = certificate(tmp_path).cert.read_bytes()
    assert certificate(tmp_path).cert.read_bytes() == first


def later(days):
    return lambda: clock.utc() + datetime.timedelta(days=days)


@pytest.mark.parametrize(("days", "renewed"), [(0, False), (LEAF_DAYS - 40, False), (370, True)])
def test_it_is_renewed_before_it_ends_by_the_same_authority(tmp_path, monkeypatch, days, renewed):
    before = certificate(tmp_path)
    cert, authority = before.cert.read_bytes(), before.authority.read_bytes()
    monkeypatch.setattr(tls, "utc", later(days))
    certificate(tmp_path)
    assert (before.cert.read_bytes() != cert) == renewed
    assert before.authority.read_bytes() == authority


def test_a_new_address_or_name_makes_a_new_one(tmp_path, monkeypatch):
    assert "198.51.100.7" not in names_of(load(certificate(tmp_path).cert))
    monkeypatch.setattr(tls, "_towards_others", lambda: ["198.51.100.7"])
    assert "198.51.100.7" in names_of(load(certificate(tmp_path).cert))
    assert "x.lan" in names_of(load(certificate(tmp_path, ["x.lan"]).cert))


@pytest.mark.parametrize("broken", ["server", "server-key", "ca-key", "ca"])
def test_what_is_lost_or_broken_is_made_again(tmp_path, broken):
    certificate(tmp_path)
    path = tmp_path / f"{broken}.pem"
    if broken == "server":
        path.write_text("rubbish")
    else:
        path.unlink()
    made = certificate(tmp_path)
    load(made.cert).verify_directly_issued_by(load(made.authority))
    key = serialization.load_pem_private_key(made.key.read_bytes(), None)
    assert key.public_key() == load(made.cert).public_key()


def test_a_key_of_another_certificate_is_made_again(tmp_path):
    made, other = certificate(tmp_path / "one"), certificate(tmp_path / "other")
    made.key.write_bytes(other.key.read_bytes())
    certificate(tmp_path / "one")
    key = serialization.load_pem_private_key(made.key.read_bytes(), None)
    assert key.public_key() == load(made.cert).public_key()


def test_a_client_that_trusts_the_authority_connects_by_name_and_address(tmp_path):
    made = certificate(tmp_path)
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(made.cert, made.key)
    trusting = ssl.create_default_context(cafile=made.authority)
    for name in ("127.0.0.1", "localhost"):
        left, right = socket.socketpair()
        with left, right:
            shake = threading.Thread(target=lambda end=left: server.wrap_socket(end, True).close())
            shake.start()
            with trusting.wrap_socket(right, server_hostname=name) as secure:
                assert secure.version() in ("TLSv1.2", "TLSv1.3")
            shake.join()


def test_the_likeliest_address_comes_first_and_loopback_last(monkeypatch):
    monkeypatch.setattr(tls, "_towards_others", lambda: ["192.0.2.9", "fe80::1", "127.0.0.1"])
    monkeypatch.setattr(tls, "_of_interfaces", lambda: ["10.42.0.1", "192.0.2.9", "169.254.1.1"])
    assert own_addresses() == ["192.0.2.9", "10.42.0.1", "127.0.0.1", "::1"]


def test_every_interface_is_found():
    assert "127.0.0.1" in tls._of_interfaces()


def limits_of(made):
    extension = load(made.authority).extensions.get_extension_for_class(x509.NameConstraints)
    assert extension.critical
    return extension.value.permitted_subtrees


def test_the_authority_lives_two_years_at_most_and_signs_for_this_network_alone(tmp_path):
    made = certificate(tmp_path, ["robot.lab"])
    authority = load(made.authority)
    life = authority.not_valid_after_utc - authority.not_valid_before_utc
    assert life <= datetime.timedelta(days=2 * 365)
    permitted = limits_of(made)
    for name in (*own_names(), "robot.lab", "a.robot.lab", "192.168.7.7", "10.0.0.1", "fd00::7"):
        assert is_permitted(name, permitted)
    for name in ("bank.example", "notlocalhost", "lab", "xrobot.lab", "203.0.113.77", "2a00::1"):
        assert not is_permitted(name, permitted)


def shake_hands(made, leaf, key, name):
    """Connect as a client that trusts the authority; raises ssl.SSLError if that is refused."""
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(leaf, key)
    trusting = ssl.create_default_context(cafile=made.authority)
    left, right = (ssl.MemoryBIO() for _ in range(2))
    here = trusting.wrap_bio(left, right, server_hostname=name)
    there = server.wrap_bio(right, left, server_side=True)
    for _ in range(4):
        for end in (here, there):
            with contextlib.suppress(ssl.SSLWantReadError):
                end.do_handshake()
    assert here.version() is not None


@pytest.mark.parametrize("name", ["bank.example", "203.0.113.77", "2a00:1450::1"])
def test_who_steals_its_key_deceives_nobody_about_others(tmp_path, name):
    made = certificate(tmp_path / "state")
    stolen = {key: tmp_path / "state" / f"{key}.pem" for key in ("ca", "ca-key")}
    forged = stolen | {key: tmp_path / f"{key}.pem" for key in ("server", "server-key")}
    tls._make_leaf(forged, ["localhost"])
    shake_hands(made, forged["server"], forged["server-key"], "localhost")
    tls._make_leaf(forged, [name])
    with pytest.raises(ssl.SSLCertVerificationError, match="permitted subtree violation"):
        shake_hands(made, forged["server"], forged["server-key"], name)


@pytest.mark.skipif(shutil.which("openssl") is None, reason="NO openssl, not tested")
def test_openssl_verifies_the_chain(tmp_path):
    made = certificate(tmp_path, ["robot.lab"])
    command = ["openssl", "verify", "-x509_strict", "-purpose", "sslserver", "-CAfile"]
    for check in (["-verify_ip", "127.0.0.1"], ["-verify_hostname", "robot.lab"]):
        told = subprocess.run(
            [*command, made.authority, *check, made.cert], capture_output=True, text=True
        )
        assert told.returncode == 0, told.stderr


def unlimited(tmp_path):
    """As an earlier version made it: any name, ten years."""
    made = certificate(tmp_path)
    paths = {name: tmp_path / f"{name}.pem" for name in ("ca", "ca-key", "server", "server-key")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tls, "AUTHORITY_DAYS", 3650)
        everything = x509.NameConstraints([x509.DNSName("")], None)
        tls._make_authority(paths, everything)
        tls._make_leaf(paths, own_names())
    return made


@pytest.mark.parametrize("old", ["unlimited", "nearly over", "of another machine"])
def test_an_authority_that_will_not_do_is_replaced_and_that_is_said_once(
    tmp_path, monkeypatch, caplog, old
):
    made = unlimited(tmp_path) if old == "unlimited" else certificate(tmp_path)
    before = made.authority.read_bytes()
    if old == "nearly over":
        monkeypatch.setattr(tls, "utc", later(AUTHORITY_DAYS - 40))
    if old == "of another machine":
        monkeypatch.setattr(socket, "gethostname", lambda: "other-machine")
    for _ in range(3):
        certificate(tmp_path)
    assert made.authority.read_bytes() != before
    load(made.cert).verify_directly_issued_by(load(made.authority))
    assert [record.message for record in caplog.records].count(caplog.records[0].message) == 1
    assert "install /ca.crt" in caplog.records[0].message


def test_no_certificate_outlives_its_authority(tmp_path, monkeypatch):
    made = certificate(tmp_path)
    monkeypatch.setattr(tls, "utc", later(AUTHORITY_DAYS - 100))
    certificate(tmp_path)
    assert load(made.cert).not_valid_after_utc <= load(made.authority).not_valid_after_utc


def test_a_public_address_that_changes_needs_no_new_trust(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(tls, "_towards_others", lambda: ["192.168.1.5", "2001:db8::5"])
    made = certificate(tmp_path)
    before = made.authority.read_bytes()
    monkeypatch.setattr(tls, "_towards_others", lambda: ["192.168.9.5", "2001:db8:9::5"])
    assert "192.168.9.5" in names_of(load(certificate(tmp_path).cert))
    assert "2001:db8:9::5" not in names_of(load(made.cert))
    assert made.authority.read_bytes() == before
    assert caplog.records == []


@given(st.ip_addresses(), st.lists(st.ip_addresses(), max_size=3))
def test_an_authority_signs_for_all_it_was_made_for_and_private_addresses(address, own):
    permitted = authority_limits(map(str, own)).permitted_subtrees
    assert all(is_permitted(str(one), permitted) for one in own)
    if any(address.version == net.version and address in net for net in PRIVATE):
        assert is_permitted(str(address), permitted)
