"""The training stages of section 5.4: each subnetwork alone, then joined ones."""

import dataclasses
from dataclasses import dataclass

from lime_keras.networks import SUBNETWORKS, Architecture, subnetwork_names

from .terms import LEARNING

WARM_UP = 0.02
"""Share of a stage in which Muon's learning rate rises from nearly 0."""


@dataclass(frozen=True)
class Stage:
    """A stage, which trains some subnetworks together.

    Attributes:
        subnetworks: names of the trained subnetworks. They read one another's predictions, and the
            ground truth in place of all other subnetworks' predictions.
        steps: number of batches.
        learning_rate: largest learning rate.
        cosine: whether the learning rate falls to 0 by the last batch, along half a cosine.
        optimizer: a key of `optimizer.OPTIMIZERS`. Muon's learning rate first rises from 0.
    """

    subnetworks: tuple[str, ...]
    steps: int
    learning_rate: float
    cosine: bool = False
    optimizer: str = "adam"

    @property
    def name(self) -> str:
        """The names of the subnetworks, joined by "+", such as `specular+mirror`."""
        return "+".join(self.subnetworks)


@dataclass(frozen=True)
class Schedule:
    """The lengths and learning rates of all stages.

    Attributes:
        batch_size: number of examples in a batch.
        single_steps: batches of a U-Net trained alone, and of the baseline's ReflectanceMapNet.
        encoder_steps: batches of an encoder trained alone: AlbedoNet, ExponentNet, and the
            baseline's MaterialNet.
        single_learning_rate: learning rate for a subnetwork trained alone.
        joint_steps: batches of each stage of joined subnetworks.
        joint_learning_rate: learning rate for joined subnetworks.
        validation_examples: number of held-out examples that a stage is evaluated on.
        papers: whether training is that of section 5.4: by Adam at a constant learning rate, on the
            scenes as they are rendered, with true masks, by mean squared errors of mask and
            albedos. Otherwise

            - Muon trains, and the learning rate of each stage falls to 0 along half a cosine;
            - scenes are mirrored left to right, each with a probability of one half, and get new
              albedos each time;
            - SegmentationNet learns from images with several colours on the objects
              (`lime_keras.data.clutter`), all others from images with prints
              (`lime_keras.data.prints`), and on masks as SegmentationNet finds them and on damaged
              ones (`train.sources.masks`);
            - `losses.mask_structure` and absolute errors stand in place of the squares.
    """

    batch_size: int
    single_steps: int
    encoder_steps: int
    single_learning_rate: float
    joint_steps: int
    joint_learning_rate: float
    validation_examples: int
    papers: bool = True

    def scaled(self, factor: float, rate: float = 1.0) -> "Schedule":
        """Return the schedule with `factor` times the batches and `rate` times the learning rates.

        Each stage keeps at least one batch.
        """
        steps = {
            name: max(1, round(getattr(self, name) * factor))
            for name in ("single_steps", "encoder_steps", "joint_steps")
        }
        return dataclasses.replace(
            self,
            **steps,
            single_learning_rate=self.single_learning_rate * rate,
            joint_learning_rate=self.joint_learning_rate * rate,
        )

    def stages(self, architecture: Architecture) -> list[Stage]:
        """Return all stages of a system, in the order of training."""
        here = subnetwork_names(architecture)
        cosine, optimizer = (False, "adam") if self.papers else (True, "muon")
        rounds = {name: LEARNING[name].joined for name in here}
        out = [
            Stage(
                (name,),
                self.encoder_steps if SUBNETWORKS[name].encoder else self.single_steps,
                self.single_learning_rate,
                cosine,
                LEARNING[name].optimizer or optimizer,
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
                out.append(Stage(joined, self.joint_steps, rate, cosine, optimizer))
        return out


_LIVE = Schedule(
    batch_size=16,
    single_steps=20_000,
    encoder_steps=30_000,
    single_learning_rate=2e-3,
    joint_steps=5_000,
    joint_learning_rate=4e-4,
    validation_examples=512,
    papers=False,
)

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
    # Hours on two cores, an hour on a GPU; nano in a quarter of the time.
    "nano": _LIVE,
    "live": _LIVE,
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
