"""Functions that are handed to a kernel: by their address, for less takes longer (a function as such, 8 µs a call)."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def call(typing_context: Any, address: Any, *arguments: Any) -> tuple[Any, Callable[..., Any]]:
    """Call the function at an address, which takes arguments of these types and returns an integer."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        takes = [context.get_value_type(one) for one in signature.args[1].types]
        function = ir.FunctionType(context.get_value_type(types.int64), takes).as_pointer()
        return builder.call(builder.inttoptr(args[0], function), cgutils.unpack_tuple(builder, args[1]))

    return types.int64(types.int64, types.StarArgTuple(arguments)), codegen
