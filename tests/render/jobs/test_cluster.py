"""Rendering on a Ray cluster, whose nodes are sets of processes on this machine's loopback."""

import contextlib
import dataclasses
import json
import os
import shutil
import signal
import socket
import sys
import tempfile
import threading
import time
from collections import Counter

import pytest
from render_scenes import describe, write_inputs

from lime_keras.render import cli
from lime_keras.render.corpus import split, worker
from lime_keras.render.jobs import cluster, inputs, nodes, processes, resuming
from lime_keras.render.jobs.description import Job
from lime_keras.render.mitsuba_setup import variants

ray = pytest.importorskip("ray", reason="Ray is in the extra `cluster`")
# Clusters are started, watched dying, and shut down.
pytestmark = pytest.mark.slow

NODE = r"^node 127\.0\.0\.[23]: "
SMALL = {"object_store_memory": 80 * 2**20, "include_dashboard": False}


@pytest.fixture(autouse=True)
def environment_kept(monkeypatch):
    """Rendering sets these for its workers."""
    for name in processes.THREAD_VARIABLES:
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")


@pytest.fixture(scope="module")
def head():
    """A cluster's first node, which is this process' and renders nothing."""
    from ray.cluster_utils import Cluster

    # Not in pytest's folder: the names of sockets must be short.
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory(prefix="ray-") as home:
        patch.setenv("RAY_TMPDIR", home)
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        # A dead node is found out in seconds, and one that is slow to answer not taken for dead.
        health = {
            "health_check_period_ms": 500,
            "health_check_timeout_ms": 2000,
            "health_check_failure_threshold": 4,
        }
        started = Cluster(True, head_node_args=SMALL | {"num_cpus": 0, "_system_config": health})
        yield started
        ray.shutdown()
        started.shutdown()


@pytest.fixture(scope="module")
def pair(head):
    """Two more nodes, of one processor each."""
    return [
        head.add_node(**SMALL, num_cpus=1, node_ip_address=address)
        for address in ("127.0.0.2", "127.0.0.3")
    ]


@pytest.fixture(scope="module")
def description(tmp_path_factory, mitsuba_choice):
    folder = write_inputs(tmp_path_factory.mktemp("inputs"))
    return describe(folder, 8, mitsuba_choice.variant)


@pytest.fixture
def job(tmp_path, description):
    """A job whose folder is claimed for it, of files of its own."""
    folders = {"shapes": str(tmp_path / "shapes"), "environments": str(tmp_path / "environments")}
    write_inputs(tmp_path)
    own = dataclasses.replace(description, **folders)
    job = Job(tmp_path / "corpus", own, variants.Choice(variants.SLOW, None))
    job.split.folder.mkdir(parents=True)
    resuming.write_json(job.split.description_path, job.description.recorded())
    found = {
        kind: [inputs.check(kind, path) for path in job.description.files()[kind]]
        for kind in job.description.files()
    }
    inputs.write(job.split.inputs_path, found)
    return job


@pytest.fixture(scope="module")
def rendered(tmp_path_factory, description, mitsuba_choice):
    """The corpus as one machine renders it."""
    out = tmp_path_factory.mktemp("rendered")
    render(out, description, mitsuba_choice)
    return out


def nothing(done, total):
    """Follows no progress."""


def render(out, description, choice, head=None, on_example=nothing):
    split.render_split(
        out,
        description,
        choice,
        workers=1,
        ray=head and head.address,
        on_input=nothing,
        on_room=nothing,
        on_example=on_example,
    )


def contents(out):
    names = ("*.tfrecord", "manifest.json", "description.json")
    return {path.name: path.read_bytes() for name in names for path in (out / "train").glob(name)}


def run(head, job, task, items, total, tell=None):
    """Run a task that renders nothing; gives the progress that was told.

    Tasks that a test defines inside itself travel to the nodes as code.
    """
    told = []
    pool = cluster.Cluster(head.address, [], lambda job, ticks: ticks, job)
    try:
        pool.run(task, items, 0, total, tell or (lambda *news: told.append(news)))
    finally:
        assert not ray.is_initialized()
    return told


def test_shards_are_spread_over_processes_of_one_thread(head, pair, job, monkeypatch):
    monkeypatch.setattr(cluster, "TASKS_PER_PROCESS", 2)
    folder, names = job.split.folder, processes.THREAD_VARIABLES

    def task(ticks, item):
        node, threads = ray.util.get_node_ip_address(), [os.environ[name] for name in names]
        telling = folder / f"telling-{item}"
        telling.write_text(json.dumps([node, os.getpid(), threads]))
        telling.rename(folder / f"told-{item}")  # no one reads a part of it
        while len({json.loads(path.read_text())[0] for path in folder.glob("told-*")}) < 2:
            time.sleep(0.05)
        ticks.put(1)

    progress = run(head, job, task, list(range(5)), 5)
    told = [json.loads(path.read_text()) for path in folder.glob("told-*")]
    assert {node for node, _, _ in told} == {node.node_ip_address for node in pair}
    tasks = Counter(process for _, process, _ in told)
    assert tasks.total() == 5 and max(tasks.values()) == 2
    assert all(threads == ["1", "1", "1"] for _, _, threads in told)
    assert progress == sorted(progress) and progress[-1] == (5, 5)


def test_a_lost_process_is_replaced_and_what_it_did_not_counted_twice(head, pair, job):
    """What it did is told before it is lost, and before the other task does anything."""
    seen, died, progress = job.split.folder / "seen", job.split.folder / "died", []

    def task(ticks, item):
        if item == 0:
            ticks.put(2)
            ticks.put(1)
        while not (seen, died)[item].exists():
            time.sleep(0.05)
        if item == 1:
            ticks.put(3)
        elif not died.exists():
            died.touch()
            os._exit(1)
        time.sleep(1)  # what is counted twice is told

    def tell(done, total):
        progress.append((done, total))
        if done == 3:
            seen.touch()

    run(head, job, task, [0, 1], 6, tell)
    assert died.exists()
    assert progress == sorted(progress) and progress[-1] == (6, 6)


def test_an_interruption_ends_the_tasks(head, pair, job):
    begun = job.split.folder / "begun"

    def task(ticks, item):
        begun.write_text(str(os.getpid()))
        ticks.put(1)
        time.sleep(600)

    def interrupt(done, total):
        if done:  # where a task is going to run is news, too
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(head, job, task, [0], 1, tell=interrupt)
    with pytest.raises(ProcessLookupError):
        for _ in range(1200):
            os.kill(int(begun.read_text()), 0)
            time.sleep(0.05)


def test_a_shard_that_always_loses_its_process_is_given_up(head, pair, job, monkeypatch):
    monkeypatch.setattr(cluster, "_RETRIES", 1)
    with pytest.raises(RuntimeError, match=r"lost its process 2 times, last as \w+: .*goes on"):
        run(head, job, lambda ticks, item: os._exit(1), [0], 1)


def test_a_node_that_falls_silent_is_not_waited_for(head, pair, job, capsys):
    """As if its cable were cut: nothing tells that its process will never answer."""
    silent = head.add_node(**SMALL, num_cpus=1, node_ip_address="127.0.0.5")
    address, halt = silent.node_ip_address, job.split.folder / "halt"

    def task(ticks, item):
        if ray.util.get_node_ip_address() == address:
            halt.write_text(str(os.getpid()))
            os.kill(os.getppid(), signal.SIGSTOP)
            os.kill(os.getpid(), signal.SIGSTOP)
        while not halt.exists():
            time.sleep(0.05)
        (job.split.folder / f"done-{item}").touch()

    try:
        run(head, job, task, [0, 1, 2], 3)
    finally:
        head.remove_node(silent, allow_graceful=False)
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            os.kill(int(halt.read_text()), signal.SIGKILL)
    assert len(list(job.split.folder.glob("done-*"))) == 3
    assert f"node {address} is lost" in capsys.readouterr().err


def test_what_a_task_raises_names_the_node(head, pair, job):
    def task(ticks, item):
        raise ValueError("/meshes/teapot.ply: holds no triangle")

    with pytest.raises(RuntimeError, match=NODE + r"/meshes/teapot\.ply: holds no"):
        run(head, job, task, [0], 1)


def test_a_node_with_other_packages_is_refused_by_name(head, pair, job, monkeypatch):
    asked = {"numpy": "0.1", "nil": "1.0", "ray": ray.__version__, "lime-keras": "0"}
    monkeypatch.setattr(resuming, "versions", lambda packages: asked)
    differing = r"numpy \S+ there, 0\.1 here, nil not installed there, 1\.0 here, lime-keras "
    with pytest.raises(RuntimeError, match=NODE + differing):
        run(head, job, print, [0], 1)


def test_a_node_that_sees_other_files_is_refused(job):
    """As what a node sees is what this process sees, the files are changed after the resuming."""
    nodes._refuse_other_files(job)
    mesh, description = job.description.files()["shapes"][0], job.split.folder / "description.json"
    claimed = description.read_text()
    mesh.write_bytes(mesh.read_bytes() + b" ")
    with pytest.raises(RuntimeError, match=rf"^{mesh.name} changed .*; all nodes must share"):
        nodes._refuse_other_files(job)
    shutil.rmtree(mesh.parent)
    with pytest.raises(RuntimeError, match=rf"^{mesh.parent} .*; all nodes must share"):
        nodes._refuse_other_files(job)
    description.write_text(claimed.replace('"seed": 0', '"seed": 1'))
    with pytest.raises(RuntimeError, match=rf"^{description} is another split's there"):
        nodes._refuse_other_files(job)
    description.unlink()
    with pytest.raises(RuntimeError, match=rf"^{description} is not seen there"):
        nodes._refuse_other_files(job)


def test_a_node_that_does_not_see_the_corpus_is_named(head, pair, job):
    shutil.rmtree(job.split.folder)
    with pytest.raises(
        RuntimeError, match=r"^node 127\.0\.0\.[23]: /.*description.json is not seen"
    ):
        run(head, job, print, [0], 1)


def test_nodes_of_another_processor_are_told_once(head, pair, job, monkeypatch, capsys):
    run(head, job, print, [0, 1], 1)
    assert "processor" not in capsys.readouterr().err
    monkeypatch.setattr(nodes, "processor", lambda: ["abacus"])
    run(head, job, lambda ticks, item: time.sleep(0.5), [0, 1, 2, 3], 1)
    errors = capsys.readouterr().err.splitlines()
    told = [line.split()[1] for line in errors if "has another kind of processor" in line]
    assert told and len(told) == len(set(told))


def test_lost_nodes_and_a_cluster_without_any_are_told(capsys):
    assert cluster._lost({"a": "10.0.0.1", "b": "10.0.0.2"}, {"b": "10.0.0.2"}) == {"a"}
    told = ["", "node 10.0.0.1 is lost: its shards go to the others"]
    assert capsys.readouterr().err.splitlines() == told
    assert cluster._lost(None, {"b": "10.0.0.2"}) == cluster._lost({}, {}) == set()
    assert not capsys.readouterr().err
    for before in (None, {"b": "10.0.0.2"}):
        cluster._lost(before, {})
        assert "waiting for one to join" in capsys.readouterr().err


def test_a_node_uses_its_own_library_of_the_same_variant(monkeypatch, tmp_path):
    wanted = variants.Choice(variants.FAST, tmp_path / "here.so")
    own = variants.Choice(variants.FAST, tmp_path / "there.so")
    monkeypatch.setattr(variants, "choose", lambda device=None: own)
    assert nodes._own_choice(wanted) == own
    slow = variants.Choice(variants.SLOW, None)
    assert nodes._own_choice(slow) == slow
    monkeypatch.setattr(variants, "choose", lambda device=None: slow)
    with pytest.raises(RuntimeError, match=r"llvm_ad_rgb cannot run there.*fetch_llvm"):
        nodes._own_choice(wanted)


def test_the_command_gives_the_bytes_of_one_machine(
    head, pair, rendered, description, mitsuba_choice, tmp_path, monkeypatch, capsys
):
    """Even where a relative path means another folder to the nodes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(variants, "choose", lambda device=None: mitsuba_choice)
    options = ["--split", "train", "--count", "8", "--size", "64", "--shard-size", "2"]
    laws = ["--light-law", description.light_law, "--endless", str(description.endless)]
    folders = ["--shapes", description.shapes, "--environments", description.environments]
    assert cli.main(["corpus", *options, *laws, *folders, "--ray", head.address]) == 0
    printed, _ = capsys.readouterr()
    assert printed == "8 examples in corpus/train\n"
    assert contents(tmp_path / "corpus") == contents(rendered)


def test_the_bytes_are_the_same_though_a_node_is_killed_half_way(
    head, pair, rendered, description, mitsuba_choice, tmp_path, monkeypatch, capsys
):
    """One node stops in the middle of its first shard, and is killed when the other has begun."""
    doomed, folder = head.add_node(**SMALL, num_cpus=1, node_ip_address="127.0.0.4"), tmp_path
    half_way, address = folder / "half-way", doomed.node_ip_address

    def render_shard(held, shard):
        tell = held.ticks.put

        def tell_and_stop(count):
            tell(count)
            half_way.touch()
            time.sleep(600)

        if ray.util.get_node_ip_address() == address:
            held.ticks.put = tell_and_stop
        elif shard > 0:  # three shards are left to three nodes
            while not half_way.exists():
                time.sleep(0.05)
        worker.render_shard(held, shard)

    def kill(done, total):
        if half_way.exists() and doomed in head.worker_nodes:
            assert list((folder / "train").glob("partial-*")) and done < total
            head.remove_node(doomed, allow_graceful=False)
            while any(node["Alive"] and node["NodeName"] == address for node in ray.nodes()):
                time.sleep(0.1)

    monkeypatch.setattr(worker, "render_shard", render_shard)
    render(tmp_path, description, mitsuba_choice, head, kill)
    assert doomed not in head.worker_nodes
    assert contents(tmp_path) == contents(rendered)
    assert not list((folder / "train").glob("partial-*"))
    printed, errors = capsys.readouterr()
    assert f"node {address} is lost" in errors and not printed


@contextlib.contextmanager
def listener(answer):
    """A port where every caller gets an answer, or silence."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            with contextlib.suppress(OSError):
                while True:
                    callers.append(server.accept()[0])
                    callers[-1].sendall(answer)

        callers = []
        threading.Thread(target=serve, daemon=True).start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        for caller in callers:
            caller.close()


@pytest.mark.parametrize("scheme", ["", "ray://"])
@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
def test_an_address_of_something_else_is_told_at_once(job, monkeypatch, scheme, answer):
    """Ray alone would try for two minutes, and end the process."""
    monkeypatch.setattr(cluster, "_SECONDS_TO_ANSWER", 0.5)
    with listener(answer) as address:
        with pytest.raises(
            RuntimeError, match=f"no Ray cluster answers at {scheme}{address} .*ray start --head"
        ):
            cluster.Cluster(scheme + address, [], print, job)


@pytest.mark.parametrize(
    "address", ["127.0.0.1:1", "nobody.invalid:6379", "127.0.0.1:65536", "no-port"]
)
def test_an_address_of_nothing_is_told_at_once(job, monkeypatch, tmp_path, address):
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    began = time.monotonic()
    with pytest.raises(RuntimeError, match=r"Ray cluster .*ray start --head"):
        cluster.Cluster(address, [], print, job).run(print, [0], 0, 1, nothing)
    assert time.monotonic() - began < 60
    assert not ray.is_initialized()


def test_a_lack_of_ray_is_told_by_the_command(monkeypatch, mitsuba_choice, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.setattr(variants, "choose", lambda device=None: mitsuba_choice)
    maps = str(write_inputs(tmp_path) / "environments")
    options = ["--split", "train", "--count", "1", "--environments", maps, "--ray", "auto"]
    assert cli.main([str(tmp_path / "corpus"), *options]) == 1
    assert "pip install '.[cluster]'" in capsys.readouterr().err


def test_local_workers_and_a_cluster_exclude_one_another(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(["corpus", "--split", "train", "--count", "1", "--workers", "99", "--ray", "auto"])
    assert stop.value.code == 2 and "not allowed with" in capsys.readouterr().err
