"""Items of typed lists without a reference, for ``kernel(leaf=True)``, see `refweb.kernels.kernel`."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic
from numba.typed.listobject import ll_list_type, ll_voidptr_type
from numba.typed.typedobjectutils import _container_get_data


def _item(typing_context, values, place):
    kind = values.item_type

    def code(context, builder, signature, arguments):
        shape = ir.FunctionType(ll_voidptr_type, [ll_list_type])
        begin = cgutils.get_or_insert_function(builder.module, shape, "numba_list_base_ptr")
        items = builder.call(begin, [_container_get_data(context, builder, values, arguments[0])])
        items = builder.bitcast(items, context.get_data_type(kind).as_pointer())
        found = context.data_model_manager[kind].load_from_data_pointer(builder, builder.gep(items, [arguments[1]]))
        if context.enable_nrt:  # whoever counts references gives this one back
            context.nrt.incref(builder, kind, found)
        return found

    return kind(values, place), code


item: Any = intrinsic(_item)
"""Item of a typed list at a place, which is not checked: for a leaf, to which it is lent while it is on the list."""
