"""Make `chromium.mcap`: a real headless Chromium leads the robot for some seconds.

python -m tests.data.record_chromium [seconds]
"""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

from hardware.robot_file import load_robot
from hardware.sim.hand import make_hand
from tests.e2e.chromium_phone import ChromiumPhone, browser
from tests.e2e.conftest import find_chromium
from tests.e2e.serving import serving
from tests.e2e.test_chromium_loop import LANDSCAPE, calibrate, lead, start

TARGET = Path(__file__).with_name("chromium.mcap")


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    executable = find_chromium()
    if executable is None:
        sys.exit("no Chromium found: apt-get install chromium")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cameras = calibrate(folder)
        with (
            serving(folder, "--cameras", str(cameras)) as server,
            browser(executable, **LANDSCAPE) as context,
        ):
            hand = make_hand("moving", seed=3, t_start=time.monotonic() + 8.0)
            leds_in_b = load_robot("ames").robot.leds_in_b
            made = ChromiumPhone(context, hand, leds_in_b, server.truth_port)
            with closing(made) as phone:
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
