"""The refusal of bad data: the outcome of a case in which an error is right."""

from collections.abc import Callable

from lime_keras.eval.stability.verdicts import Outcome, first_line


class UnrefusedError(Exception):
    """Bad data that was accepted, or refused with the wrong message."""


def refusal(action: Callable[[], object], *words: str) -> Outcome:
    """Run an action on bad data, and return the outcome of its refusal by a `ValueError`.

    Args:
        action: function that uses the bad data.
        words: texts that the error's message must contain.

    Raises:
        UnrefusedError: if the action accepts the data, or its message lacks one of the words.
    """
    try:
        answer = action()
    except ValueError as error:
        if missing := [word for word in words if word not in str(error)]:
            raise UnrefusedError(f"refused without saying {missing}: {error}") from error
        return Outcome(note=f"refused: {first_line(error)}")
    raise UnrefusedError(f"taken, and answered with a {type(answer).__name__}")
