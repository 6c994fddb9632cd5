"""The eight stages of section 5.4: each subnetwork alone on truth, then joined ever further."""

from dataclasses import dataclass

SINGLE = ("segmentation", "specular", "mirror", "albedo", "exponent")


@dataclass(frozen=True)
class Stage:
    """Some subnetworks trained together, each fed by the others' answers where they are present.

    Attributes:
        subnetworks: names of those trained; what they need of the others is taken from the truth.
        steps: batches.
        learning_rate: Adam's.
    """

    subnetworks: tuple[str, ...]
    steps: int
    learning_rate: float

    @property
    def name(self) -> str:
        """Such as `specular+mirror`."""
        return "+".join(self.subnetworks)


@dataclass(frozen=True)
class Schedule:
    """How long and how fast each stage learns.

    Attributes:
        batch_size: examples a batch.
        single_steps: batches of stages 1 to 5, by subnetwork.
        single_learning_rate: Adam's in stages 1 to 5.
        joint_steps: batches of each of stages 6 to 8.
        joint_learning_rate: Adam's in stages 6 to 8.
        validation_examples: how many held-out examples are looked at, at most.
    """

    batch_size: int
    single_steps: dict[str, int]
    single_learning_rate: float
    joint_steps: int
    joint_learning_rate: float
    validation_examples: int

    def stages(self) -> list[Stage]:
        """All eight, in order."""
        single = [
            Stage((name,), self.single_steps[name], self.single_learning_rate) for name in SINGLE
        ]
        joined = (
            ("specular", "mirror"),
            ("specular", "mirror", "exponent"),
            ("specular", "mirror", "exponent", "albedo"),
        )
        joint = [Stage(names, self.joint_steps, self.joint_learning_rate) for names in joined]
        return single + joint


SCHEDULES = {
    # All stages in 8 minutes on two cores; accuracy well above chance, far below the paper's.
    "smoke": Schedule(
        batch_size=16,
        single_steps={
            "segmentation": 300,
            "specular": 400,
            "mirror": 250,
            "albedo": 400,
            "exponent": 400,
        },
        single_learning_rate=1e-3,
        joint_steps=60,
        joint_learning_rate=1e-4,
        validation_examples=48,
    ),
    # Section 5.4 to the letter.
    "paper": Schedule(
        batch_size=32,
        single_steps=dict.fromkeys(SINGLE, 100_000),
        single_learning_rate=1e-4,
        joint_steps=45_000,
        joint_learning_rate=1e-4,
        validation_examples=1024,
    ),
}
