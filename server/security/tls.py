"""TLS for a LAN: an authority of this installation's own, and a certificate for its addresses."""

from __future__ import annotations

import datetime
import fcntl
import ipaddress
import logging
import socket
import struct
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from server.common.clock import utc
from server.common.runtime import one_at_a_time, private_directory, replacement
from server.security.tls_limits import authority_limits, general_name, is_permitted

LEAF_DAYS, AUTHORITY_DAYS = 397, 729
RENEW_DAYS, RENEW_AUTHORITY_DAYS = 30, 60
AUTHORITY_LOCK = "ca.lock"
SIOCGIFADDR = 0x8915  # linux/sockios.h
log = logging.getLogger("lightleash")


@dataclass(frozen=True, slots=True)
class Certificate:
    """Files for a TLS server."""

    cert: Path
    key: Path
    authority: Path | None
    """To be installed on phones; None for a certificate of the user's own."""


def own_addresses() -> list[str]:
    """IP addresses by which others may reach this machine, the likeliest first, loopback last."""
    near = [ipaddress.ip_address(text) for text in (*_towards_others(), *_of_interfaces())]
    useful = (str(a) for a in near if not (a.is_loopback or a.is_link_local))
    return [*dict.fromkeys(useful), "127.0.0.1", "::1"]


def _towards_others() -> list[str]:
    """Addresses of the interfaces that lead to the rest of the world."""
    found: list[str] = []
    for target in ("192.0.2.1", "2001:db8::1"):  # documentation addresses: nothing is sent
        family = socket.AF_INET6 if ":" in target else socket.AF_INET
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            try:
                probe.connect((target, 9))
                found.append(probe.getsockname()[0])
            except OSError:
                continue
    return found


def _of_interfaces() -> list[str]:
    """IPv4 addresses of all interfaces, such as a hotspot for the phone; Linux only."""
    if not sys.platform.startswith("linux"):
        return []
    found: list[str] = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            request = struct.pack("256s", name.encode()[:15])
            try:
                answer = fcntl.ioctl(probe, SIOCGIFADDR, request)
            except OSError:  # an interface without an address
                continue
            found.append(socket.inet_ntoa(answer[20:24]))
    return found


def own_hosts() -> list[str]:
    """Names of this machine."""
    host = socket.gethostname().lower()
    return ["localhost", host, f"{host}.local"]


def own_names() -> list[str]:
    """Names and addresses this server answers to."""
    return [*own_addresses(), *own_hosts()]


def certificate(
    state: Path, names: Iterable[str] = (), own: Path | None = None, also: Iterable[str] = ()
) -> Certificate:
    """The certificate in `own` for this machine and `names`, made or renewed if it must be.

    So is the authority in `state` that signs it, with a word in the log if phones trusted another
    one. It signs for names and addresses of this machine and for private addresses, nothing else.
    Servers that share `state` share the authority: a phone trusts one, and so all. They must have
    the same `names`, for which alone it may sign: another list makes another authority.
    What it is `also` reached by is in the certificate as far as the authority may sign for it.
    """
    own = private_directory(own or state)
    private_directory(state)
    paths = {name: state / f"{name}.pem" for name in ("ca", "ca-key")}
    paths |= {name: own / f"{name}.pem" for name in ("server", "server-key")}
    with one_at_a_time(state / AUTHORITY_LOCK):  # two that start at once make one authority
        return _renewed(paths, names, also)


def _renewed(paths: dict[str, Path], names: Iterable[str], also: Iterable[str]) -> Certificate:
    addresses, hosts = [*own_addresses(), *also], [*own_hosts(), *names]
    if not _is_good_authority(paths, [addresses[0], *hosts]):
        if paths["ca"].exists():
            log.warning(
                "A new certificate authority: the one before was unlimited, old, or not for this "
                "machine. Phones that trusted it must install /ca.crt of this server again."
            )
        _make_authority(paths, authority_limits([*addresses, *hosts]))
    permitted = _limits_of(load(paths["ca"])).permitted_subtrees or []
    wanted = [name for name in (*addresses, *hosts) if is_permitted(name, permitted)]
    if not _is_good(paths, wanted):
        _make_leaf(paths, wanted)
    return Certificate(paths["server"], paths["server-key"], paths["ca"])


def _is_good_authority(paths: dict[str, Path], needed: Iterable[str]) -> bool:
    """Whether it is limited and short-lived, lasts, has its key and may sign for `needed`."""
    try:
        authority = load(paths["ca"])
        key = serialization.load_pem_private_key(paths["ca-key"].read_bytes(), None)
        permitted = _limits_of(authority).permitted_subtrees or []
    except (OSError, ValueError, TypeError, x509.ExtensionNotFound):
        return False
    life = authority.not_valid_after_utc - authority.not_valid_before_utc
    return (
        key.public_key() == authority.public_key()
        and life.days <= AUTHORITY_DAYS
        and _days_left(authority) > RENEW_AUTHORITY_DAYS
        and all(is_permitted(name, permitted) for name in needed)
    )


def _is_good(paths: dict[str, Path], wanted: Iterable[str]) -> bool:
    """Whether the certificate is ours, has its key, lasts, and names all that is wanted."""
    try:
        leaf = load(paths["server"])
        leaf.verify_directly_issued_by(load(paths["ca"]))
        key = serialization.load_pem_private_key(paths["server-key"].read_bytes(), None)
        if key.public_key() != leaf.public_key():
            return False
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, TypeError, InvalidSignature, x509.ExtensionNotFound):
        return False
    named = {str(name.value) for name in names}
    return _days_left(leaf) > RENEW_DAYS and set(wanted) <= named


def _make_authority(paths: dict[str, Path], limits: x509.NameConstraints) -> None:
    key = ec.generate_private_key(ec.SECP256R1())
    name = _name(f"Lightleash on {socket.gethostname()}")
    certificate_ = (
        _builder(name, name, key, AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(limits, critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    _write(paths["ca"], certificate_.public_bytes(serialization.Encoding.PEM))
    _write(paths["ca-key"], _private(key))


def _make_leaf(paths: dict[str, Path], wanted: Iterable[str]) -> None:
    authority = load(paths["ca"])
    authority_key = serialization.load_pem_private_key(paths["ca-key"].read_bytes(), None)
    assert isinstance(authority_key, ec.EllipticCurvePrivateKey)
    key = ec.generate_private_key(ec.SECP256R1())
    names = [general_name(name) for name in dict.fromkeys(wanted)]
    leaf = (
        _builder(_name("Lightleash"), authority.subject, key, min(LEAF_DAYS, _days_left(authority)))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()),
            critical=False,
        )
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(_usage(signs=False), critical=True)
        .sign(authority_key, hashes.SHA256())
    )
    _write(paths["server"], leaf.public_bytes(serialization.Encoding.PEM))
    _write(paths["server-key"], _private(key))


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, days: int
) -> x509.CertificateBuilder:
    now = utc()
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(days=days))
    )


def _usage(signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=signs,
        crl_sign=signs,
        encipher_only=False,
        decipher_only=False,
    )


def load(path: Path) -> x509.Certificate:
    """The certificate in a file.

    Raises:
        OSError: there is no such file.
        ValueError: it holds no certificate.
    """
    return x509.load_pem_x509_certificate(path.read_bytes())


def fingerprint(authority: Path) -> str:
    """SHA-256 of a certificate, as browsers and phones show it.

    Raises:
        OSError: there is no such file.
        ValueError: it holds no certificate.
    """
    return load(authority).fingerprint(hashes.SHA256()).hex(":").upper()


def _limits_of(authority: x509.Certificate) -> x509.NameConstraints:
    return authority.extensions.get_extension_for_class(x509.NameConstraints).value


def _days_left(one: x509.Certificate) -> int:
    return (one.not_valid_after_utc - utc()).days


def _name(common: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common[:64])])


def _private(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )


def _write(path: Path, data: bytes) -> None:
    with replacement(path, private=True) as part:
        part.write_bytes(data)
