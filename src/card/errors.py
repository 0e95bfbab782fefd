"""The one error a user sees."""


class CardError(Exception):
    """A problem with the user's input, told in one line: where, what, found, wanted.

    Parameters
    ----------
    what : the problem in a few words.
    where : file, frame, line or field it concerns.
    found, wanted : the value met and the value that would be right.
    """

    def __init__(
        self, what: str, *, where: object = None, found: object = None, wanted: object = None
    ) -> None:
        self.what = what
        self.where = where
        self.found = found
        self.wanted = wanted
        details = [
            f"{name} {value}" for name, value in (("found", found), ("wanted", wanted)) if value is not None
        ]
        line = f"{where}: {what}" if where is not None else what
        if details:
            line += f" ({', '.join(details)})"
        super().__init__(" ".join(line.split()))
