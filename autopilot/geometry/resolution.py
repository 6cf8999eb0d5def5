"""What a call of an operator or of one of numba's functions resolves to, looked up once for the same types.

numba tries some forty candidates at each place where two numbers are added, and builds a text for each one
that does not match: a tenth of the compile time.
"""

from __future__ import annotations

from typing import Any

from numba.core.targetconfig import ConfigStack
from numba.core.types.functions import BaseFunction

_resolve = BaseFunction.get_call_type
# signature and implementation; also the function, so that its id is not reused
_resolved: dict[Any, tuple[Any, Any, Any]] = {}
_options: dict[int, tuple[Any, str]] = {}  # flags of a function being compiled, with their text


def _current_options() -> str:
    """The options of the function being compiled as a text; numba would build it anew each time."""
    flags = ConfigStack.top_or_none()
    if id(flags) not in _options:
        _options[id(flags)] = (flags, repr(flags))
    return _options[id(flags)][1]


def _call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """As numba's `get_call_type`: return the signature, and record the implementation in the function."""
    key = (id(function), id(context), args, tuple(kws.items()), _current_options())
    if key not in _resolved:
        signature = _resolve(function, context, args, kws)
        _resolved[key] = (signature, function.get_impl_key(signature), function)
    signature, implementation, _ = _resolved[key]
    # the same call may have set another one since, in a function compiled with other options
    function._impl_keys[signature.args] = implementation
    return signature


BaseFunction.get_call_type = _call_type
