"""What the link's code costs: `python -m tests.bench.bench_link`; CPU time [µs] a datagram."""

import ctypes
import subprocess
import tempfile
import time
from pathlib import Path

from hardware.link.datagram import CommandDatagram, decode_command, encode_command
from hardware.link.link_key import mac

SOURCE = Path(__file__).parents[2] / "deploy" / "watchdog"
KEY, ROUNDS, TRIES = bytes(range(16)), 20_000, 5
COMMAND = CommandDatagram(1, 2, 3, 4, True, (1.0,) * 8)
LOOP = """
#include "hmac.h"
#include <string.h>
#include <time.h>
double cost_us(const uint8_t *data, size_t size, long rounds);
double cost_us(const uint8_t *data, size_t size, long rounds)
{
    ll_hmac h;
    uint8_t digest[LL_DIGEST_BYTES], copy[256], key[16] = {0};
    ll_hmac_init(&h, key, sizeof key);
    memcpy(copy, data, size);
    clock_t begin = clock();
    for (long i = 0; i < rounds; i++) {
        ll_hmac_of(&h, copy, size, digest);
        memcpy(copy, digest, 16);
    }
    return 1e6 * (double)(clock() - begin) / CLOCKS_PER_SEC / (double)rounds;
}
"""


def in_c(data: bytes) -> float:
    with tempfile.TemporaryDirectory() as name:
        loop, library = Path(name) / "loop.c", Path(name) / "loop.so"
        loop.write_text(LOOP)
        words = ("gcc", "-O2", "-shared", "-fPIC", f"-I{SOURCE}", "-o", str(library), str(loop))
        subprocess.run((*words, str(SOURCE / "hmac.c")), check=True)
        c = ctypes.CDLL(str(library))
        c.cost_us.restype = ctypes.c_double
        size, rounds = ctypes.c_size_t(len(data)), ctypes.c_long(ROUNDS)
        return min(c.cost_us(data, size, rounds) for _ in range(TRIES))


def in_python(work) -> float:
    costs = []
    for _ in range(TRIES):
        begin = time.thread_time()
        for _ in range(ROUNDS):
            work()
        costs.append(1e6 * (time.thread_time() - begin) / ROUNDS)
    return min(costs)


def main() -> None:
    command, sample = encode_command(COMMAND, KEY)[:-16], bytes(92 - 16 + 32)
    for name, data in (("command", command), ("sample", sample)):
        print(f"MAC of a {name} of 8 thrusters ({len(data)} bytes), µs:", end=" ")
        print(f"C {in_c(data):.2f}, Python {in_python(lambda d=data: mac(KEY, d)):.2f}")
    whole = encode_command(COMMAND, KEY)
    print(
        f"whole command, Python, µs: encoded {in_python(lambda: encode_command(COMMAND, KEY)):.2f}"
    )
    print(f"whole command, Python, µs: decoded {in_python(lambda: decode_command(whole, KEY)):.2f}")


if __name__ == "__main__":
    main()
