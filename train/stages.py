"""The stages of section 5.4: each subnetwork alone on truth, then joined ever further."""

import dataclasses
from dataclasses import dataclass

from lime_keras.networks import SUBNETWORKS, Architecture, names

from .terms import LEARNING


@dataclass(frozen=True)
class Stage:
    """Some subnetworks trained together, each fed by the others' answers where they are present.

    Attributes:
        subnetworks: names of those trained; what they need of the others is taken from the truth.
        steps: batches.
        learning_rate: Adam's.
        cosine: whether it falls to nothing by the last batch, along half a cosine.
    """

    subnetworks: tuple[str, ...]
    steps: int
    learning_rate: float
    cosine: bool = False

    @property
    def name(self) -> str:
        """Such as `specular+mirror`."""
        return "+".join(self.subnetworks)


@dataclass(frozen=True)
class Schedule:
    """How long and how fast each stage learns.

    Attributes:
        batch_size: examples a batch.
        single_steps: batches of a U-Net alone (and of the baseline's ReflectanceMapNet).
        encoder_steps: batches of an encoder alone: AlbedoNet, ExponentNet, the baseline's
            MaterialNet.
        single_learning_rate: Adam's, of each subnetwork alone.
        joint_steps: batches of each stage of joined subnetworks.
        joint_learning_rate: Adam's, of joined subnetworks.
        validation_examples: how many held-out examples are looked at, at most.
        cosine: whether each stage's learning rate falls to nothing, along half a cosine.
        flips: whether every other scene is learnt from as a mirror shows it.
        repaints: whether each scene is learnt from in albedos drawn anew.
    """

    batch_size: int
    single_steps: int
    encoder_steps: int
    single_learning_rate: float
    joint_steps: int
    joint_learning_rate: float
    validation_examples: int
    cosine: bool = False
    flips: bool = False
    repaints: bool = False

    def scaled(self, factor: float) -> "Schedule":
        """The same with `factor` times the batches, at least one a stage."""
        steps = {
            name: max(1, round(getattr(self, name) * factor))
            for name in ("single_steps", "encoder_steps", "joint_steps")
        }
        return dataclasses.replace(self, **steps)

    def stages(self, architecture: Architecture) -> list[Stage]:
        """All stages of a system, in order."""
        here = names(architecture)
        rounds = {name: LEARNING[name].joined for name in here}
        out = [
            Stage(
                (name,),
                self.encoder_steps if SUBNETWORKS[name].encoder else self.single_steps,
                self.single_learning_rate,
                self.cosine,
            )
            for name in LEARNING
            if name in here
        ]
        for last in sorted({number for number in rounds.values() if number is not None}):
            joined = tuple(
                name for name, number in rounds.items() if number is not None and number <= last
            )
            if len(joined) > 1:
                rate = self.joint_learning_rate
                out.append(Stage(joined, self.joint_steps, rate, self.cosine))
        return out


SCHEDULES = {
    # All stages in 8 minutes on two cores; accuracy well above chance, far below the paper's.
    "smoke": Schedule(
        batch_size=16,
        single_steps=320,
        encoder_steps=400,
        single_learning_rate=1e-3,
        joint_steps=60,
        joint_learning_rate=1e-4,
        validation_examples=48,
    ),
    # Hours on two cores, an hour on a GPU.
    "live": Schedule(
        batch_size=16,
        single_steps=20_000,
        encoder_steps=30_000,
        single_learning_rate=5e-4,
        joint_steps=5_000,
        joint_learning_rate=1e-4,
        validation_examples=512,
        cosine=True,
        flips=True,
        repaints=True,
    ),
    # Section 5.4 to the letter.
    "paper": Schedule(
        batch_size=32,
        single_steps=100_000,
        encoder_steps=100_000,
        single_learning_rate=1e-4,
        joint_steps=45_000,
        joint_learning_rate=1e-4,
        validation_examples=1024,
    ),
}
