"""Stages under another backend or on several devices: run with a folder, leaves arrays there.

A process of its own, for the backend and the devices are fixed when Keras is imported.
"""

import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import keras
import numpy as np

from lime_keras import shininess, weights
from lime_keras.networks import SUBNETWORKS, Architecture, assemble, build
from lime_keras.train import stage_training, trainer
from lime_keras.train.config import Config, corpus_sha256
from lime_keras.train.devices import Devices
from lime_keras.train.optimizer import LossScale, WatchedAdam, gradient_norms
from lime_keras.train.stage_model import StageModel
from lime_keras.train.stages import Schedule

TINY = Architecture(size=32, unet_width=2, unet_depth=2, encoder_width=2, dense_width=4)
SYSTEMS = {
    "lime": TINY,
    "regression": dataclasses.replace(TINY, mirror=False, exponent="regression"),
    "baseline": dataclasses.replace(TINY, system="reflectance-map"),
}
BRIEF = Schedule(
    batch_size=4,
    single_steps=3,
    encoder_steps=5,
    single_learning_rate=1e-3,
    joint_steps=4,
    joint_learning_rate=1e-3,
    validation_examples=4,
)
# The second of the held-out batches is one example, which two devices cannot share.
UNEVEN = dataclasses.replace(BRIEF, validation_examples=5)


def start(what, folder, environment):
    """Run this program on the processor, in an environment that fixes backend and devices."""
    on_processor = {"CUDA_VISIBLE_DEVICES": "", "JAX_PLATFORMS": "cpu"}
    done = subprocess.run(
        [sys.executable, __file__, what, folder],
        env=os.environ | on_processor | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]


def stages(system):
    """Of a system's, those that LIME itself has not."""
    found = BRIEF.stages(SYSTEMS[system])
    known = set() if system == "lime" else set(BRIEF.stages(TINY)[:4])
    return [stage for stage in found if stage not in known]


def config(corpus, architecture=TINY, **changes):
    whole = Config("tiny", 1.0, architecture, BRIEF, 0, corpus_sha256([corpus]), camera=True)
    return dataclasses.replace(whole, **changes)


def ignore(progress):
    pass


def interrupted_at(stage, step):
    """What to tell, so that training stops there with a checkpoint of that step."""

    def interrupt(progress):
        if (progress.stage.name, progress.step) == (stage, step + 1):
            raise KeyboardInterrupt

    return interrupt


# Backends.


def answers(model):
    """Of each subnetwork to noise, and of all together to an image, by name."""
    _, subnetworks = weights.load(model)
    rng = np.random.default_rng(0)
    out = {}
    for name, network in subnetworks.items():
        seen = [rng.uniform(size=(2, *one.shape[1:])).astype(np.float32) for one in network.inputs]
        for index, answer in enumerate(
            keras.tree.flatten(network(seen if len(seen) > 1 else seen[0]))
        ):
            out[f"{name}/{index}"] = keras.ops.convert_to_numpy(answer)
    image = rng.uniform(size=(2, TINY.size, TINY.size, 3)).astype(np.float32)
    for name, answer in assemble(subnetworks)(image).items():
        out[f"together/{name}"] = keras.ops.convert_to_numpy(answer)
    return out


def first_steps(model, batch, system):
    """Losses, gradients and their norms of each stage's first step, by stage, kind and name."""
    _, subnetworks = weights.load(model)
    before = {name: network.get_weights() for name, network in subnetworks.items()}
    out = {}
    for stage in stages(system):
        networks = {name: subnetworks[name] for name in stage.subnetworks}
        for name, network in networks.items():
            network.set_weights(before[name])
        model = StageModel(networks)
        groups = [(name, len(network.trainable_variables)) for name, network in networks.items()]
        # After one step Adam's mean of the gradients is a quarter of them.
        optimizer = WatchedAdam(1e-3, groups, beta_1=0.75)
        # TensorFlow takes longer to compile a step than to run it.
        eager = keras.backend.backend() == "tensorflow"
        model.compile(optimizer=optimizer, run_eagerly=eager)
        optimizer.build(model.trainable_variables)
        seen = {name: value for name, value in batch.items() if name in model.features}
        losses = model.train_on_batch(seen, return_dict=True)
        means = [one for one in optimizer.variables if one.path.endswith("_momentum")]
        gradients = {
            one.path: 4 * keras.ops.convert_to_numpy(mean)
            for one, mean in zip(model.trainable_variables, means, strict=True)
        }
        kinds = {"loss": losses, "norm": gradient_norms(optimizer), "gradient": gradients}
        for kind, values in kinds.items():
            for name, value in values.items():
                out[f"{stage.name}|{kind}|{name}"] = np.asarray(value)
    return out


def another_backend(folder):
    """All that `test_backends` asks of a backend."""
    corpus = folder / "corpus"
    batch = dict(np.load(folder / "batch.npz"))
    for name in SYSTEMS:
        np.savez(folder / f"answers-{name}.npz", **answers(folder / name))
        np.savez(folder / f"steps-{name}.npz", **first_steps(folder / name, batch, name))
        weights.save(folder / f"back-{name}", *weights.load(folder / name))
    stage_training._SECONDS_BETWEEN_CHECKPOINTS = 0
    baseline = config(corpus, SYSTEMS["baseline"])
    trainer.train([corpus], folder / "whole", baseline, ignore)
    try:
        trainer.train([corpus], folder / "resumed", baseline, interrupted_at("material", 1))
    except KeyboardInterrupt:
        trainer.train([corpus], folder / "resumed", baseline, ignore)
    told = []
    trainer.train(
        [corpus],
        folder / "begun",
        config(corpus),
        lambda progress: told.append(progress.step),
        only=["specular"],
    )
    (folder / "carried-on.json").write_text(json.dumps(told), encoding="utf-8")


# Devices.

RUNS = {
    "tensorflow": {"one": ("float32", 1), "two": ("float32", 2), "half": ("float16", 2)},
    "jax": {"two": ("float32", 2), "one": ("float32", 1)},
}
"""Precision and number of devices, by backend and name."""


def two_devices(folder):
    """All that `test_devices` asks of a process that has two."""
    if keras.backend.backend() == "tensorflow":
        import tensorflow as tf

        processor = tf.config.list_physical_devices("CPU")[0]
        halves = [tf.config.LogicalDeviceConfiguration()] * 2
        tf.config.set_logical_device_configuration(processor, halves)
    left = {
        "three": _error(lambda: Devices(3)),
        "overflow": overflow_on_the_second(),
        "measured": [measured(Devices(2)), measured(Devices(1))],
    }
    corpus = folder / "corpus"
    for name, (precision, devices) in RUNS[keras.backend.backend()].items():
        trainer.train(
            [corpus],
            folder / name,
            config(corpus, schedule=UNEVEN, precision=precision),
            ignore,
            only=["albedo"],
            devices=devices,
        )
    corpus = folder / "broken"
    left["broken"] = _error(
        lambda: trainer.train(
            [corpus],
            folder / "stopped",
            config(corpus, camera=False),
            ignore,
            only=["albedo"],
            devices=2,
        )
    )
    (folder / "left.json").write_text(json.dumps(left), encoding="utf-8")


def measured(devices):
    """All measures of answers to noise, of batches of which one cannot be shared by two."""
    rng = np.random.default_rng(4)
    with devices.scope():
        subnetworks = build(TINY)
        model = StageModel(
            {name: subnetworks[name] for name in SUBNETWORKS}, True, devices.replicas
        )
        model.compile()
    # Into the range where masks end and layers are above 0.
    lift = {"segmentation": 0.36, "specular": 0.9, "mirror": 0.9}
    for name, network in subnetworks.items():
        network.set_weights([rng.normal(0, 0.25, one.shape) for one in network.get_weights()])
        if name in lift:
            bias = network.get_layer("head").bias
            bias.assign(bias + lift[name])
    for count in (4, 1):
        batch = {name: keras.ops.convert_to_tensor(one) for name, one in noise(rng, count).items()}
        seen = {name: batch[name] for name in model.features}
        model.test_on_batch(devices.split(seen), sample_weight=devices.weights(seen))
    return model.measured()


def noise(rng, count):
    """A batch of examples that no renderer made."""
    size = TINY.size
    exponent = 10 ** rng.uniform(0, 3, count)
    batch = {
        **{name: rng.uniform(size=(count, size, size, 3)) for name in ("image", "clipped")},
        **{
            name: rng.exponential(size=(count, size, size, 1))
            for name in ("diffuse_shading", "specular_shading", "mirror")
        },
        "mask": rng.uniform(size=(count, size, size, 1)),
        "diffuse_albedo": rng.uniform(size=(count, 3)),
        **{name: rng.uniform(size=count) for name in ("specular_albedo", "ambient")},
        "shininess": exponent,
    }
    single = {name: value.astype(np.float32) for name, value in batch.items()}
    return single | {"exponent_bin": shininess.bin_of(exponent)}


def overflow_on_the_second():
    """Scale, steps taken and weight, after a batch of which only the second half overflows."""
    devices = Devices(2)
    with devices.scope():
        model = Product(devices.replicas)
        optimizer = LossScale(WatchedAdam(0.1, [("weight", 1)]), initial_scale=2.0**120)
        model.compile(optimizer=optimizer)
        optimizer.build(model.trainable_variables)
    model.train_on_batch(devices.split({"factor": keras.ops.array([1.0, 1.0, 1e5, 1e5])}))
    after = (optimizer.dynamic_scale, optimizer.iterations, model.weight)
    return [float(keras.ops.convert_to_numpy(one.value)) for one in after]


class Product(keras.Model):
    """One weight; the loss is the mean of its products with the batch."""

    def __init__(self, replicas):
        super().__init__()
        self.weight = self.add_weight(shape=(), initializer="ones")
        self._replicas = replicas
        self.built = True

    def call(self, batch):
        return batch["factor"] * self.weight

    def compute_loss(self, x=None, y=None, y_pred=None, sample_weight=None, **_):
        return keras.ops.mean(y_pred) / self._replicas


def _error(action):
    try:
        action()
    except (RuntimeError, ValueError) as error:
        return f"{type(error).__name__}: {error}"
    return "none"


if __name__ == "__main__":
    {"backend": another_backend, "devices": two_devices}[sys.argv[1]](Path(sys.argv[2]))
