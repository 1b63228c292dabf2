"""Which of an answer's addresses we knock at: private ones, and the one the answer came from.

A paired phone must not make the server send datagrams to whomever it names: neither to the
internet, nor to programs on this machine that trust the loopback interface.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from ipaddress import ip_address, ip_network

from aioice import Candidate, ice, mdns

PREFIX = "a=candidate:"
LOCAL_NAME = re.compile(r"[0-9a-fA-F-]{36}\.local")
PRIVATE = tuple(
    map(
        ip_network,
        (
            *("10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16"),
            "100.64.0.0/10",  # carriers and overlay networks
            *("fc00::/7", "fe80::/10"),
        ),
    )
)


def is_private(host: str) -> bool:
    """Whether it is an address that only networks like ours use."""
    try:
        address = ip_address(host)
    except ValueError:
        return False
    return any(address.version == net.version and address in net for net in PRIVATE)


def reachable(sdp: str, source: str, own: Collection[str], with_relay: bool) -> str:
    """`sdp` without the candidates that we don't knock at.

    `source` is the address the answer came from; if that is one of this machine's `own`, so may
    candidates be. Names of this network (mDNS) stay: what they stand for is checked when it is
    known. `with_relay` keeps relayed candidates, for a server that was told of a relay.
    """
    plain_source = source.removeprefix("::ffff:")
    allowed = {source, plain_source, *(own if plain_source in own else ())}

    def knocks_at(line: str) -> bool:
        words = line.split(" ")
        if not line.startswith(PREFIX) or len(words) < 8:
            return True
        host, kind = words[4], words[7]
        if LOCAL_NAME.fullmatch(host) or (with_relay and kind == "relay"):
            return True
        host = str(ip_address(host))  # as we write it
        return host in allowed or (is_private(host) and host not in own)

    return "".join(line for line in sdp.splitlines(keepends=True) if knocks_at(line.rstrip()))


def walled(validate: Callable[[Candidate, str], str]) -> Callable[[Candidate, str], str]:
    """`validate` that takes a name's address only if it is private: anybody may answer mDNS."""

    def validate_remote_candidate(candidate: Candidate, host: str) -> str:
        if mdns.is_mdns_hostname(candidate.host) and not is_private(host):
            raise ValueError(f"{candidate.host} is {host}, which is not of this network")
        return validate(candidate, host)

    return validate_remote_candidate


def build_wall() -> None:
    """Once in a process."""
    ice.validate_remote_candidate = walled(ice.validate_remote_candidate)  # type: ignore[assignment]
