"""The processors of a job: its affinity, and the quotas of its control groups."""

import os

import pytest

from lime_keras import processors


@pytest.fixture
def machine(monkeypatch, tmp_path):
    """`machine(cores, groups, files)`: a machine of eight cores with two threads each."""

    def build(allowed, membership="", files=()):
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: allowed)
        for number in range(16):
            core = tmp_path / f"cpu{number}" / "topology"
            core.mkdir(parents=True)
            (core / "thread_siblings_list").write_text(f"{number % 8},{number % 8 + 8}\n")
        for name, content in dict(files).items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(content)
        (tmp_path / "member").write_text(membership)
        monkeypatch.setattr(processors, "_TOPOLOGY", tmp_path)
        monkeypatch.setattr(processors, "_GROUPS", tmp_path / "groups")
        monkeypatch.setattr(processors, "_MEMBERSHIP", tmp_path / "member")
        return processors.count()

    return build


def test_two_threads_of_a_core_count_once(machine):
    assert machine(set(range(16))) == 8


def test_an_affinity_is_obeyed(machine):
    assert machine({1, 2, 9}) == 2


@pytest.mark.parametrize(
    ("membership", "files"),
    [
        ("0::/a/b\n", {"groups/a/b/cpu.max": "max 100000\n", "groups/a/cpu.max": "250000 100000"}),
        ("0::/\n", {"groups/cpu.max": "300000 100000\n"}),
        (
            "4:memory:/x\n2:cpu,cpuacct:/x\n",
            {
                "groups/cpu/x/cpu.cfs_quota_us": "300000\n",
                "groups/cpu/x/cpu.cfs_period_us": "100000",
                "groups/cpu/cpu.cfs_quota_us": "-1\n",
                "groups/cpu/cpu.cfs_period_us": "100000",
            },
        ),
    ],
    ids=["nested", "container", "version 1"],
)
def test_a_quota_is_obeyed(machine, membership, files):
    assert machine(set(range(16)), membership, files) == 3


def test_less_than_a_processor_is_one(machine):
    assert machine({0}, "0::/\n", {"groups/cpu.max": "20000 100000\n"}) == 1


def test_a_machine_without_control_groups_has_all(machine, monkeypatch, tmp_path):
    machine({0, 1, 2})
    monkeypatch.setattr(processors, "_MEMBERSHIP", tmp_path / "away")
    monkeypatch.setattr(processors, "_TOPOLOGY", tmp_path / "away")
    assert processors.count() == 3
