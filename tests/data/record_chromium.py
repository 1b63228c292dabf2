"""Make `chromium.mcap`: a real headless Chromium leads the robot for some seconds.

python -m tests.data.record_chromium [seconds]
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from tests.e2e.chromium_rig import lead, led_server, start
from tests.e2e.conftest import wanted_chromium

TARGET = Path(__file__).with_name("chromium.mcap")


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    executable = wanted_chromium()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with led_server(executable, folder, "moving", seed=3, rest_s=8.0) as (server, _, phone):
            start(phone, server)
            server.request("POST", "/api/recording")
            phone.play(1.0)
            lead(phone)
            phone.play(seconds)
            path = server.request("DELETE", "/api/recording")["path"]
        shutil.copy(str(path), TARGET)
    print(f"{TARGET}: {TARGET.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
