"""Functions that are handed to a kernel by their address: handed as functions they would take 8 µs a call."""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


@intrinsic
def call(typing_context: Any, address: Any, *arguments: Any) -> tuple[Any, Callable[..., Any]]:
    """Call the function at an address, which takes arguments of these types and returns an integer."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        takes = [context.get_value_type(one) for one in signature.args[1].types]
        function = ir.FunctionType(context.get_value_type(types.int64), takes).as_pointer()
        given = [builder.extract_value(args[1], number) for number in range(len(takes))]
        return builder.call(builder.inttoptr(args[0], function), given)

    return types.int64(types.int64, types.StarArgTuple(arguments)), codegen
