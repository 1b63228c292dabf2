"""Make `docs/*.png`: both pages, at phone and desktop sizes, while a Chromium leads the robot.

python -m tests.e2e.screenshots [folder]
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from tests.e2e.chromium_rig import lead, led_server, start
from tests.e2e.conftest import wanted_chromium

DESKTOP, PHONE = (1440, 900), (412, 915)


def main() -> None:
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "docs")
    executable = wanted_chromium()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with led_server(executable, folder, "demo", rest_s=10.0) as (server, context, phone):
            phone.page.goto(f"{server.local_https}/{server.link()}")
            phone.page.wait_for_selector("#start:visible")
            phone.page.screenshot(path=target / "phone-start.png")
            portrait = {"width": PHONE[0], "height": PHONE[1]}
            landscape = {"width": PHONE[1], "height": PHONE[0]}
            phone.page.set_viewport_size(portrait)
            phone.page.screenshot(path=target / "phone-start-portrait.png")
            phone.page.set_viewport_size(landscape)
            start(phone, server)
            phone.page.set_viewport_size(portrait)
            phone.play(1.0)
            phone.page.screenshot(path=target / "phone-portrait.png")
            phone.page.set_viewport_size(landscape)
            lead(phone)
            phone.play(12.0)
            phone.page.screenshot(path=target / "phone-landscape.png")
            phone.let_go()
            phone.page.close()
            assert context.browser is not None
            wide = context.browser.new_context(viewport={"width": DESKTOP[0], "height": DESKTOP[1]})
            board = wide.new_page()
            board.goto(f"{server.http_url}/supervisor{server.link('supervisor')}")
            time.sleep(3.0)  # the lease of the phone that left
            board.click("#virtual")
            time.sleep(35.0)  # the 3D view takes its time without a graphics card
            board.screenshot(path=target / "supervisor.png", timeout=60_000)
            board.set_viewport_size({"width": PHONE[0], "height": PHONE[1]})
            print("mode:", server.request("GET", "/api/status")["mode"])
            time.sleep(6.0)
            board.screenshot(path=target / "supervisor-phone.png", full_page=True, timeout=60_000)


if __name__ == "__main__":
    main()
