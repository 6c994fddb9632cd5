"""The run of a recipe: each step once, by the package's own commands as processes.

A run's folder holds:

- `recipe.json`: the recipe, its hash, and the digest of the data;
- `data.json`: the SHA-256 of each mesh and map that was there to be used;
- `data/`: links to them, the validation side in the subfolders `test`;
- `cutouts/`, `places/`, `corpora/NAME/`, `trainings/NAME/`: what the steps make;
- `steps/NAME.json`: the record of each step: command, hash, seconds, commits, machine, versions;
- `model/`, `onnx/`: the set, whose `training.json` has all of these records, and its measures;
- `eval/`: its evaluation on the validation scenes.
"""

import dataclasses
import hashlib
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lime_keras import machine
from lime_keras.io import atomic, locking, untrusted
from lime_keras.model import folder as model_folder
from lime_keras.model import gloss_file

from .. import cli, graphs
from ..provenance import commit, differences
from . import cutouts, data, recipe, steps
from .recipe import Package, Recipe

_THREADS = ("OMP_NUM_THREADS", "TF_NUM_INTRAOP_THREADS", "TF_NUM_INTEROP_THREADS")
"""Variables that limit threads; in which order numbers are summed follows from them."""
_LAUNCH = {"lime-render": "render", "lime-train": "train", "lime-eval": "evaluate"}
"""Function of `lime_keras.launch` that runs a command."""
_UNKNOWN = "unknown: no checkout"
_NAMED = 5  # differences in a message
_SECONDS_TO_END = 5, 30
"""Time that a command has to end by a terminal's Ctrl-C, which is sent to all, and by ours."""


def carry_out(
    name: str,
    folder: Path,
    *,
    data_folder: Path | None = None,
    seed: int | None = None,
    scale: float = 1.0,
    reuse: Path | None = None,
) -> None:
    """Carry out a recipe, or go on with it.

    Args:
        name: name of the recipe, or path of a file of one (`recipe.find`).
        folder: folder of the run.
        data_folder: folder with meshes and environments; needed if the recipe reads them.
        seed: seed of the trainings; None for the recipe's.
        scale: factor of all lengths, for a trial (`Recipe.scaled`).
        reuse: folder of another run, from which equal steps are taken over.

    Raises:
        FileNotFoundError: if data are missing.
        ValueError: if the folder holds another run, or the recipe is none.
        RuntimeError: if a command fails, or another process carries out a recipe there.
    """
    chosen = recipe.find(name)
    chosen = chosen if scale == 1 else chosen.scaled(scale)
    if chosen.reads and data_folder is None:
        raise ValueError(
            f"the recipe {name} reads {' and '.join(chosen.reads)}: pass --data with a folder that "
            "has them (docs/reference/data.md)"
        )
    if data_folder is not None and not chosen.reads:
        raise ValueError(f"the recipe {name} reads no meshes and maps: leave out --data")
    if reuse is not None and not (reuse / "recipe.json").is_file():
        raise FileNotFoundError(f"{reuse} holds no run of a recipe: check --reuse")
    with locking.lock_folder(folder, "lime-train carries out a recipe in"):
        _Run(name, chosen, folder, data_folder or Path(), seed, reuse).carry_out()


class _Run:
    """A run of a recipe in its folder; the arguments are those of `carry_out`."""

    def __init__(
        self,
        name: str,
        chosen: Recipe,
        folder: Path,
        data_folder: Path,
        seed: int | None,
        reuse: Path | None,
    ):
        self._recipe, self._folder, self._reuse = chosen, folder.resolve(), reuse
        seed = chosen.seed if seed is None else seed
        # The data, and what is asked for.
        files: dict[str, str] = {}
        links = self._folder / steps.DATA
        for kind, count in chosen.reads.items():
            if (data_folder / kind).resolve() == (links / kind).resolve():
                raise ValueError(f"{links} is for links to the data: pass another --out")
            digests = data.digests(data_folder, kind)
            data.refuse_twins(digests, count)
            files |= digests
        self._record = self._begin(name, seed, files)
        for kind, count in chosen.reads.items():
            data.link_sides(data_folder, kind, count, links)
        # The steps.
        self._things = self._fetch_cutouts()
        self._steps = steps.steps(chosen, seed, any("sha256" in one for one in self._things))
        self._inputs = {
            steps.DATA: [self._record["data"], chosen.held_out],
            steps.CUTOUTS: [[one.get("sha256"), one["ranges"]] for one in self._things],
        }
        for title, step in self._steps.items():
            _check_options(title, step.command)
            if step.begins_with and (own := self._folder / step.begins_with).exists():
                raise ValueError(f"{own} would be taken for that set: pass another --out")

    def carry_out(self) -> None:
        """Take all steps that are not done, and lay the set out in the folder."""
        final = steps.last(self._recipe)
        self._complete(final)
        self._lay_out(final)
        self._complete(steps.EVALUATION)
        commits = self._write_record(final)
        _tell(f"the set is in {self._folder}: make ship WEIGHTS={self._folder} NAME=…")
        _tell(f"its evaluation on validation scenes: {self._folder / steps.EVALUATION}/report.html")
        if len(commits) > 1 or any("dirty" in one or one == _UNKNOWN for one in commits):
            _tell(f"its record names {', '.join(commits)}: one clean commit would make it again")

    def _begin(self, name: str, seed: int, files: Mapping[str, str]) -> dict[str, Any]:
        """Return the record of the run, written if there is none; refuse that of another."""
        plain = json.loads(json.dumps(dataclasses.asdict(self._recipe)))
        path, list_path = self._folder / "recipe.json", self._folder / "data.json"
        made = any(_read_record(one)["done"] for one in (self._folder / "steps").rglob("*.json"))
        if path.is_file() and made:
            with untrusted.naming(path, "the record of a recipe", "remove it"):
                record = untrusted.read_json(path)
                begun = {"recipe": record["recipe"], "seed": record["seed"]}
                begun |= {"data": untrusted.read_json(list_path)}
            asked = {"recipe": plain, "seed": seed, "data": dict(files)}
            if said := [f"{key} {a} there, {b} asked" for key, a, b in differences(begun, asked)]:
                more = f"; and {len(said) - _NAMED} more" if len(said) > _NAMED else ""
                raise ValueError(
                    f"{self._folder} holds another run: {'; '.join(said[:_NAMED])}{more}. Pass "
                    f"another --out, with --reuse {self._folder} for the steps that are the same"
                )
            return record
        if not made and any((self._folder / name).exists() for name in ("config.json", "model")):
            raise ValueError(f"{self._folder} holds a model of no recipe: pass another --out")
        known = data.listed()
        others = sum(known.get(file) != digest for file, digest in files.items())
        if others:
            _tell(
                f"{others} of {len(files)} meshes and maps are not of the list of this package, so "
                "the weights will be others (docs/reference/data.md)"
            )
        if "dirty" in (commit() or _UNKNOWN):
            _tell("this checkout has changes that no commit has: the record will say so")
        record = {
            "name": Path(name).stem,
            "recipe": plain,
            "seed": seed,
            "data": data.total(files) if files else None,
            "sha256": hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest(),
            "files_not_in_list": others,
        }
        atomic.write(list_path, json.dumps(files, indent=1) + "\n")
        atomic.write(path, json.dumps(record, indent=1) + "\n")
        return record

    def _fetch_cutouts(self) -> list[dict[str, Any]]:
        """Return the records of the packages of cut-outs, downloaded if they were not."""
        path, wanted = self._folder / "cutouts.json", self._recipe.packages
        if not wanted or not any(one.cutouts for one in self._recipe.trainings.values()):
            return []
        other = self._reuse and self._reuse / path.name
        if other is not None and not path.is_file() and _fits(other, wanted):
            atomic.write(path, other.read_bytes())
            if (other.parent / steps.CUTOUTS).is_dir():
                _link_tree(other.parent / steps.CUTOUTS, self._folder / steps.CUTOUTS)
        if not _fits(path, wanted):
            _tell("cut-outs: " + ", ".join(one.name for one in wanted))
            records = cutouts.fetch(wanted, self._folder / steps.CUTOUTS / "things")
            atomic.write(path, json.dumps({"packages": records}, indent=1) + "\n")
        out = _packages(path)
        for one in out:
            if "skipped" in one:
                _tell(
                    f"skipped: {one['package']}: {one['skipped']}; masks learn without it. To try "
                    f"again, remove {path}, and pass no --reuse"
                )
        return out

    def _restore_cutouts(self) -> None:
        """Download the cut-outs again if they are missing; they have to be those of before."""
        things = self._folder / steps.CUTOUTS / "things"
        if things.is_dir():
            return
        found = cutouts.fetch(self._recipe.packages, things)
        if [one.get("sha256") for one in found] != [one.get("sha256") for one in self._things]:
            shutil.rmtree(things)
            why = "; ".join(one.get("skipped", "another file") for one in found)
            raise RuntimeError(
                f"{things} is missing, and the packages cannot be had as they were ({why}): copy "
                "it from where the run began, or pass another --out"
            )

    def _complete(self, name: str) -> None:
        """Take a step, and before it those that it needs, unless it is done."""
        step = self._steps[name]
        if self._is_done(name, self._folder) or self._take_over(name):
            return
        for needed in step.needs:
            self._complete(needed)
        # Remove what follows from other inputs.
        record_path, key = _record_path(self._folder, name), self._key(name)
        begun = _read_record(record_path) if record_path.is_file() else {}
        if begun and begun["key"] != key:
            _tell(f"{name}: follows from other inputs than before, and is made anew")
            shutil.rmtree(self._folder / name, ignore_errors=True)
        if begun and (begun["done"] or begun["key"] != key):
            begun = {}
        if f"{steps.CUTOUTS}/things" in step.command:
            self._restore_cutouts()
        # The record, which is begun before, so that it names each commit that had a part.
        number, words = list(self._steps).index(name) + 1, shlex.join(step.command)
        _tell(f"[{number}/{len(self._steps)}] {name}: {words}")
        now, commits = commit() or _UNKNOWN, begun.get("commit", [])
        record = {
            "command": words,
            "key": key,
            "done": False,
            "seconds": begun.get("seconds", 0),
            "commit": commits if now in commits else [*commits, now],
            "machine": machine.describe(),
            "threads": {name: os.environ[name] for name in _THREADS if name in os.environ},
        }
        atomic.write(record_path, json.dumps(record, indent=1) + "\n")
        began = time.monotonic()
        try:
            _run(step.command, self._folder)
            if not step.is_there(self._folder):
                raise RuntimeError(f"`{words}` left no {step.product} in {self._folder}: see above")
            record["done"] = True
        finally:
            record["seconds"] += round(time.monotonic() - began)
            atomic.write(record_path, json.dumps(record, indent=1) + "\n")
        if name.startswith("trainings/"):
            shutil.rmtree(self._folder / name / "photos", ignore_errors=True)
        _tell(f"[{number}/{len(self._steps)}] {name}: {record['seconds'] / 60:.1f} minutes")

    def _key(self, name: str) -> str:
        """Return a hash of all that a step's result follows from, beside the code."""
        step = self._steps[name]
        words = " ".join(step.command)
        read: list[Any] = [self._inputs[kind] for kind in self._inputs if f"{kind}/" in words]
        if step.begins_with is not None:
            read.append(model_folder.digest(model_folder.shipped()[step.begins_with]))
        if name == steps.EVALUATION:
            read.append(model_folder.digest(self._folder))
        follows_from = [step.command, read, [self._key(needed) for needed in step.needs]]
        return hashlib.sha256(json.dumps(follows_from).encode()).hexdigest()

    def _is_done(self, name: str, folder: Path) -> bool:
        path = _record_path(folder, name)
        if not path.is_file() or not self._steps[name].is_there(folder):
            return False
        record = _read_record(path)
        return record["done"] and record["key"] == self._key(name)

    def _take_over(self, name: str) -> bool:
        """Take a step's result over from the run to reuse, if it is the same step and done."""
        if self._reuse is None or name == steps.EVALUATION or not self._is_done(name, self._reuse):
            return False
        _link_tree(self._reuse / name, self._folder / name)
        self._take_records(name, self._reuse)
        _tell(f"{name}: taken over from {self._reuse}")
        return True

    def _take_records(self, name: str, reuse: Path) -> None:
        """Take over the records of a step and of those before it: the set's record lists all."""
        if self._is_done(name, self._folder):
            return
        path = _record_path(reuse, name)
        if path.is_file():
            atomic.write(_record_path(self._folder, name), path.read_bytes())
        for needed in self._steps[name].needs:
            self._take_records(needed, reuse)

    def _lay_out(self, final: str) -> None:
        """Lay the last training's model and graphs out as the set."""
        trained = self._folder / final
        if not (trained / "onnx").is_dir():
            _tell(graphs.write(trained))
        if not (trained / "onnx").is_dir():
            raise RuntimeError(f"{trained} has no graphs, for the reason above")
        with gloss_file.kept(self._folder), atomic.replacing(self._folder / "model") as partial:
            shutil.copytree(trained / "model", partial)
        with atomic.replacing(self._folder / "onnx") as partial:
            shutil.copytree(trained / "onnx", partial)

    def _write_record(self, final: str) -> list[str]:
        """Write what the set was made of and how it did; return the commits of all steps."""
        paths = {name: _record_path(self._folder, name) for name in self._steps}
        taken = {name: _read_record(path) for name, path in paths.items() if path.is_file()}
        taken = {name: step for name, step in taken.items() if step["done"]}
        record = untrusted.read_json(self._folder / final / "config.json")
        record |= {"recipe": self._record, "steps": taken, "cutouts": self._things}
        record["validation"] = untrusted.read_json(self._folder / steps.EVALUATION / "metrics.json")
        text = json.dumps(record, indent=1) + "\n"
        atomic.write(self._folder / "model" / "training.json", text)
        return sorted({one for step in taken.values() for one in step["commit"]})


def _check_options(title: str, command: Sequence[str]) -> None:
    """Raise ValueError for a training that `lime-train` would refuse hours later."""
    if command[0] == "lime-train":
        try:
            cli.parser().parse_args(command[1:])
        except SystemExit as error:
            raise ValueError(f"{title}: lime-train refuses it, as it says above") from error


def _fits(path: Path, packages: Sequence[Package]) -> bool:
    """Return whether a record of cut-outs is of these packages and pictures."""
    records = _packages(path) if path.is_file() else []
    asked = [(str(one), list(one.ranges)) for one in packages]
    return [(one["package"], one.get("ranges")) for one in records] == asked


def _packages(path: Path) -> list[dict[str, Any]]:
    """Return the records of downloaded packages."""
    with untrusted.naming(path, "the record of cut-outs", "remove it"):
        return [dict(one) for one in untrusted.read_json(path)["packages"]]


def _record_path(run: Path, name: str) -> Path:
    return run / "steps" / f"{name}.json"


def _read_record(path: Path) -> dict[str, Any]:
    """Return the record of a step that was begun."""
    with untrusted.naming(path, "the record of a step", "remove it"):
        record = untrusted.read_json(path)
        # An older version wrote one commit, and only when the step was done.
        commits = [record["commit"]] if isinstance(record["commit"], str) else record["commit"]
        return {"done": True} | record | {"key": record["key"], "commit": commits}


def _run(command: tuple[str, ...], folder: Path) -> None:
    """Run one of the package's commands in a folder; raise RuntimeError if it fails.

    If it or this process is interrupted, it has ended when KeyboardInterrupt is raised.
    """
    launch = f"import sys; from lime_keras.launch import {_LAUNCH[command[0]]} as run; "
    # -P: the folder holds no modules.
    words = [sys.executable, "-P", "-c", f"{launch}sys.exit(run())", *command[1:]]
    process = subprocess.Popen(words, cwd=folder)
    try:
        status = process.wait()
    except KeyboardInterrupt:
        _end(process)
        raise
    if status == 130:
        raise KeyboardInterrupt
    if status:
        why = f"ended with status {status}, as it says above"
        if status < 0:
            killed = ": was the memory used up?" if status == -signal.SIGKILL else ""
            why = f"was ended by signal {-status}{killed}"
        raise RuntimeError(f"{command[0]} {why}; the same command of the recipe goes on from there")


def _end(process: subprocess.Popen[bytes]) -> None:
    """Let a process end by the Ctrl-C that it got, else by one of ours, else at once."""
    for seconds, then in zip(_SECONDS_TO_END, (signal.SIGINT, signal.SIGKILL), strict=True):
        try:
            process.wait(seconds)
            return
        except subprocess.TimeoutExpired:
            process.send_signal(then)
    process.wait()


def _link_tree(source: Path, target: Path) -> None:
    """Copy a folder by hard links, or by bytes where there are none."""

    def link(one: str, other: str) -> None:
        try:
            os.link(one, other)
        except OSError:
            shutil.copyfile(one, other)

    with atomic.replacing(target) as partial:
        shutil.copytree(source, partial, copy_function=link, symlinks=True)


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
