"""The training stages of section 5.4: each subnetwork alone, then joined ones."""

import dataclasses
from dataclasses import dataclass

from lime_keras.networks import SUBNETWORKS, Architecture, subnetwork_names

_STAGES = (
    *("segmentation", "specular", "mirror", "albedo", "exponent", "reflectance_map", "material"),
    "specular+mirror",
    "specular+mirror+exponent",
    "specular+mirror+exponent+albedo",
    "reflectance_map+material",
)
"""All stages in their order; a system leaves out the subnetworks that it does not have."""

# Under Muon its deep levels grew by a factor of five each, until a level above them died.
_OPTIMIZERS = {"mirror": "adam"}  # what trains a subnetwork alone, whatever the schedule says
WARM_UP = 0.02  # share of a stage in which Muon's learning rate rises from nearly 0


@dataclass(frozen=True)
class Stage:
    """A stage, which trains some subnetworks together.

    Attributes:
        subnetworks: names of the trained subnetworks. They read one another's predictions, and the
            ground truth in place of all other subnetworks' predictions.
        steps: number of batches.
        learning_rate: largest learning rate.
        optimizer: a key of `optimizer.OPTIMIZERS`. Muon's learning rate first rises from 0.
    """

    subnetworks: tuple[str, ...]
    steps: int
    learning_rate: float
    optimizer: str = "adam"

    @property
    def name(self) -> str:
        """The names of the subnetworks, joined by "+", such as `specular+mirror`."""
        return "+".join(self.subnetworks)


@dataclass(frozen=True)
class Schedule:
    """The recipe of a training: the lengths and learning rates of all stages, and their switches.

    The defaults of the switches are sections 4 to 5.4 of the paper.

    Attributes:
        batch_size: number of examples in a batch.
        single_steps: batches of a U-Net trained alone, and of the baseline's ReflectanceMapNet.
        encoder_steps: batches of an encoder trained alone: AlbedoNet, ExponentNet, and the
            baseline's MaterialNet.
        single_learning_rate: learning rate for a subnetwork trained alone.
        joint_steps: batches of all stages of joined subnetworks together, which share them equally.
        joint_learning_rate: learning rate for joined subnetworks.
        validation_examples: number of validation examples that a stage is evaluated on.
        optimizer: `adam`, or `muon`, a key of `optimizer.OPTIMIZERS`.
        cosine: whether the learning rate falls to 0 by a stage's last batch, along half a cosine.
        epsilon: Adam's ε.
        decay: the learning rate is divided by 1 + decay · batches so far, as Keras once had it.
        losses: `printed`: ℓ2 on everything but S and M, which have ℓ1, the binary cross-entropy of
            the bins, the absolute error of a regressed log10 s, and Eq. 5 as printed; or `robust`:
            `losses.mask_structure`, absolute errors of the albedos, the cross-entropy of the
            classes, the squared error of log10 s, and Eq. 5 where the photo tells.
        camera: whether the camera model photographs the scenes (`lime_keras.data.camera`).
        flips: whether scenes are mirrored left to right, each with a probability of one half.
        repaints: whether scenes get new albedos each time.
        paints: whether SegmentationNet learns from images with several colours on the objects
            (`photos.paint.clutter`), and all others from images with prints
            (`photos.paint.prints`).
        found_masks: whether the subnetworks beside SegmentationNet learn on masks as it finds them
            and on damaged ones (`photos.masks`), too.
        steps: batches of every stage; None for those of its kind.
        rate: learning rate of every stage; None for that of its kind.
        average: momentum of the optimiser's moving average of the weights (Keras' `use_ema`), which
            takes their place after a stage's last batch; None for the last weights.
    """

    batch_size: int
    single_steps: int
    encoder_steps: int
    single_learning_rate: float
    joint_steps: int
    joint_learning_rate: float
    validation_examples: int
    optimizer: str = "adam"
    cosine: bool = False
    epsilon: float = 1e-6
    decay: float = 0.0
    losses: str = "printed"
    camera: bool = False
    flips: bool = False
    repaints: bool = False
    paints: bool = False
    found_masks: bool = False
    steps: int | None = None
    rate: float | None = None
    average: float | None = None

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
        rows = (tuple(part for part in name.split("+") if part in here) for name in _STAGES)
        every = dict.fromkeys(filter(None, rows))
        joint_steps = self.joint_steps / max(1, sum(len(names) > 1 for names in every))
        return [self._stage(names, max(1, round(joint_steps))) for names in every]

    def _stage(self, names: tuple[str, ...], joint_steps: int) -> Stage:
        """Return the stage of some subnetworks."""
        steps, rate, optimizer = joint_steps, self.joint_learning_rate, self.optimizer
        if len(names) == 1:
            is_encoder, rate = SUBNETWORKS[names[0]].encoder, self.single_learning_rate
            steps = self.encoder_steps if is_encoder else self.single_steps
            optimizer = _OPTIMIZERS.get(names[0], optimizer)
        return Stage(names, self.steps or steps, self.rate or rate, optimizer)


_LIVE = Schedule(
    batch_size=16,
    single_steps=20_000,
    encoder_steps=30_000,
    single_learning_rate=2e-3,
    joint_steps=15_000,
    joint_learning_rate=4e-4,
    validation_examples=512,
    optimizer="muon",
    cosine=True,
    epsilon=1e-7,
    losses="robust",
    camera=True,
    flips=True,
    repaints=True,
    paints=True,
    found_masks=True,
)

SCHEDULES = {
    # All stages in 8 to 18 minutes on two cores; accuracy well above chance, far below the paper's.
    "smoke": Schedule(
        batch_size=16,
        single_steps=320,
        encoder_steps=400,
        single_learning_rate=1e-3,
        joint_steps=180,
        joint_learning_rate=1e-4,
        validation_examples=48,
        epsilon=1e-7,
        losses="robust",
        camera=True,
    ),
    # Hours on two cores, an hour on a GPU; nano in a quarter of the time.
    "nano": _LIVE,
    "live": _LIVE,
    # Section 5.4 to the letter; `docs/explanation/paper.md` says where the letter leaves a choice.
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
