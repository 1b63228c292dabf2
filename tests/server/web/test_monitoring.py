"""Dashboard and alerts speak of figures, and of labels, that a real answer of /metrics has."""

from __future__ import annotations

import json
import re
from contextlib import closing
from pathlib import Path

import pytest
import yaml
from msgspec.structs import replace
from prometheus_client.parser import text_string_to_metric_families
from starlette.testclient import TestClient

from hardware.codec import DecodeError
from server.control.robot_health import HealthFields
from server.media.decoding import Decoding
from server.protocol.messages import Stream
from server.web.status import build
from tests.server.house import control_status, estimate_fields, house_in

DEPLOY = Path(__file__).parents[3] / "deploy"
BASE = "http://127.0.0.1"
SCRAPED = {"up": {"instance", "job"}}
"""What Prometheus itself adds."""
SELECTOR = re.compile(r"\b(up|(?:lightleash|process)_\w+)\b(?:\{([^}]*)\})?")
LABEL = re.compile(r"(\w+)\s*(?:=~|!~|!=|=)")
LEGEND = re.compile(r"\{\{(\w+)\}\}")
BY = re.compile(r"\bby \(([^)]*)\)")


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """Labels by the name of each figure, where robot, phone and estimator tell all they can."""
    with house_in(tmp_path_factory.mktemp("told")) as house, closing(Decoding()) as decoding:
        manager = house.manager
        manager.decoding = decoding
        with pytest.raises(DecodeError):
            decoding.open("jpeg", 640, 360).decode(b"no picture")
        health = HealthFields("low", 10.4, "Low.", e_stop="pressed")
        manager.status = control_status(
            estimate=estimate_fields(), health=health, error_m=0.01, sigma_p=0.003, time_offset=0.01
        )
        manager.control_meter.tick(manager.status.t)
        seen = {"streams": {"video": Stream(30.0, 30.0)}, "latency_ms": {"decode": 4.0}}
        manager.tally.see(replace(build(manager), **seen))
        key = {"Authorization": f"Bearer {house.doors.supervisor_token}"}
        answer = TestClient(house.app, base_url=BASE, headers=key).get("/metrics")
    names: dict[str, set[str]] = dict(SCRAPED)
    for family in text_string_to_metric_families(answer.text):
        for sample in family.samples:
            names.setdefault(sample.name, {"instance", "job"}).update(sample.labels)
    return names


def alerts() -> list[dict]:
    groups = yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"]
    return [rule for group in groups for rule in group["rules"]]


def panels() -> list[dict]:
    return json.loads((DEPLOY / "dashboard.json").read_text())["panels"]


def expressions() -> list[tuple[str, str, str]]:
    """(where, expression, legend) of each."""
    ours = [(rule["alert"], rule["expr"], "") for rule in alerts()]
    asked = [(panel["title"], one) for panel in panels() for one in panel["targets"]]
    return ours + [(title, one["expr"], one["legendFormat"]) for title, one in asked]


def test_all_that_is_told_is_in_an_answer(told):
    assert {"lightleash_mode", "lightleash_undecodable_pictures_total"} <= set(told)
    assert "le" in told["lightleash_latency_seconds_bucket"]


@pytest.mark.parametrize(("where", "expression", "legend"), expressions())
def test_each_figure_and_label_is_told(told, where, expression, legend):
    named = SELECTOR.findall(expression)
    assert named
    for name, matchers in named:
        assert name in told, where
        grouped = ",".join(BY.findall(expression)).replace(" ", "").split(",")
        used = {*LABEL.findall(matchers), *LEGEND.findall(legend), *filter(None, grouped)}
        assert used <= told[name], where


def test_an_alert_says_what_to_do_and_there_is_one_for_disk_and_battery():
    rules = {rule["alert"]: rule for rule in alerts()}
    assert all(rule["annotations"]["summary"].endswith(".") for rule in rules.values())
    assert {"NothingIsRecorded", "RecordingsDiskFull"} <= set(rules)
    levels = {re.search(r'level="(\w+)"', rule["expr"]).group(1) for rule in rules.values()
              if "lightleash_robot_battery" in rule["expr"]}  # fmt: skip
    assert levels == {"low", "empty"}


def test_panels_do_not_lie_on_each_other_and_take_the_source_that_is_chosen():
    taken = set()
    for panel in panels():
        at = panel["gridPos"]
        cells = {
            (x, y)
            for x in range(at["x"], at["x"] + at["w"])
            for y in range(at["y"], at["y"] + at["h"])
        }
        assert at["x"] + at["w"] <= 24
        assert not taken & cells, panel["title"]
        taken |= cells
        assert panel["datasource"]["uid"] == "${datasource}"
    assert len({panel["id"] for panel in panels()}) == len(panels()) > 15
