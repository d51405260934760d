"""Makes message classes from the descriptors of the published protos.

Python code made by protoc works only with versions of protobuf near its own. The modules that the build puts into
`planish.v1` and `planish.rpc` use only what all versions from 3.12 on have, through this module.
"""

from __future__ import annotations

import base64
import importlib
from typing import Any, Dict

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.internal import enum_type_wrapper


def _class_of(descriptor: Any) -> Any:
    if hasattr(message_factory, "GetMessageClass"):  # protobuf 4.22 and newer
        return message_factory.GetMessageClass(descriptor)
    from google.protobuf import symbol_database

    return symbol_database.Default().GetPrototype(descriptor)


def build(module: Dict[str, Any], name: str, imports: "tuple[str, ...]", file: str) -> None:
    """Adds the contents of a module `*_pb2` to `module`, the globals of that module. `name`: of the .proto file;
    `imports`: the modules of the files that it imports; `file`: its FileDescriptorProto, in base64."""
    for each in imports:
        importlib.import_module(each)
    pool = descriptor_pool.Default()
    pool.AddSerializedFile(base64.b64decode(file))
    descriptor = module["DESCRIPTOR"] = pool.FindFileByName(name)
    for kind in descriptor.enum_types_by_name.values():
        module[kind.name] = enum_type_wrapper.EnumTypeWrapper(kind)
        module.update((value.name, value.number) for value in kind.values)
    for kind in descriptor.message_types_by_name.values():
        made = module[kind.name] = _class_of(kind)
        made.__module__ = module["__name__"]
        for nested in kind.nested_types:
            if not nested.GetOptions().map_entry and not hasattr(made, nested.name):
                setattr(made, nested.name, _class_of(nested))
