# SPDX-License-Identifier: BSD-3-Clause
"""What holba raises."""


class Error(Exception):
    """Base of what holba raises."""


class InputError(Error, ValueError):
    """A file or an option is at fault. The message says which, where in it, and what to do."""


class CheckError(Error):
    """A promise was broken.

    Either a method was given ids that are not there (the model is then as it was), or it is a fault of holba.
    """


for _error in (Error, InputError, CheckError):
    _error.__module__ = "holba"
