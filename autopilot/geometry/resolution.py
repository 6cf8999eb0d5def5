"""What a call of an operator or of a function of numba's stands for, found once for the same types.

numba asks some forty candidates at each place where two numbers are added, and puts a text together for each
that declines: a tenth of what compiling takes.
"""

from __future__ import annotations

from typing import Any

from numba.core.targetconfig import ConfigStack
from numba.core.types.functions import BaseFunction

_search = BaseFunction.get_call_type
# signature and implementation; the function too, so that no other gets its id
_found: dict[Any, tuple[Any, Any, Any]] = {}
_options: dict[int, tuple[Any, str]] = {}  # how a function is compiled, beside all of that as a text


def _options_now() -> str:
    """Of the function that is being compiled; numba goes through all of them each time."""
    flags = ConfigStack.top_or_none()
    if id(flags) not in _options:
        _options[id(flags)] = (flags, repr(flags))
    return _options[id(flags)][1]


def _call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """numba's `get_call_type`: the signature, with the implementation noted at the function."""
    key = (id(function), id(context), args, tuple(kws.items()), _options_now())
    if key not in _found:
        signature = _search(function, context, args, kws)
        _found[key] = (signature, function.get_impl_key(signature), function)
    signature, implementation, _ = _found[key]
    # which the same call may have set since, in a function that is compiled otherwise
    function._impl_keys[signature.args] = implementation
    return signature


BaseFunction.get_call_type = _call_type
