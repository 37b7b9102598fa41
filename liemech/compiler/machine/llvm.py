"""LLVM: the only file that knows its binding.  Text in LLVM's language becomes object code, and
object code becomes a function.

All that may be one thread's at a time is done under one lock, which a fork waits for, so that the
child finds LLVM at rest.
"""

from __future__ import annotations

import ctypes
import functools
import itertools
import os
import re
import threading
import weakref
from collections.abc import Sequence
from typing import Any

import llvmlite
import llvmlite.binding as llvm

from ...errors import InvalidInput, NotCompilable
from ...formulas.functions import LIBM
from . import callbacks, interrupts

VERSION: str = llvmlite.__version__
SIGNATURE = ctypes.CFUNCTYPE(None, ctypes.c_char_p)

NEAR = os.name != "nt"
"""Does code find its constants by their distance?  Else each one's address takes a register, and
steps up to a fifth more time.
"""

LONG = 20_000
"""Instructions from which a module gets the first of LLVM's levels of optimisation, not the second: the
passes take half the time, and steps are within 2 % of those at the third level.
"""

_numbers = itertools.count()
_lock = threading.RLock()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=_lock.acquire, after_in_parent=_lock.release, after_in_child=_lock.release)


@functools.cache
def machine() -> tuple[str, ...]:
    """LLVM's version, the platform and the processor for which object code is made."""
    name, instructions, _ = processor()
    return VERSION, triple(), name, instructions


@functools.cache
def processor() -> tuple[str, str, int]:
    """The processor that code is made for, this one or $LIEMECH_CPU; its instructions in the form that LLVM takes; and
    the number of doubles in a vector register.

    Raises InvalidInput for a name that LLVM does not know, and for a processor with instructions for
    numbers that this one lacks.  Others that this one lacks, of the operating system, are not used.
    """
    requested = os.environ.get("LIEMECH_CPU") or "native"
    with _lock:
        features = llvm.get_host_cpu_features()
        if requested == "native":
            return llvm.get_host_cpu_name(), features.flatten(), _width([name for name, has in features.items() if has])
        if not triple().startswith("x86_64"):
            raise InvalidInput(
                f"$LIEMECH_CPU={requested}: on {triple()} code is made for this processor only; unset it"
            )
        instructions = _instructions(requested, ["sse2", *features]) if re.fullmatch(r"[\w.-]+", requested) else []
    if not instructions:
        raise InvalidInput(
            f"$LIEMECH_CPU={requested}: LLVM {'.'.join(map(str, llvm.llvm_version_info))} knows no such processor of "
            "64 bits; name one, such as x86-64, x86-64-v3, znver2, skylake-avx512, or native"
        )
    lacking = [name for name in instructions if not features.get(name, True)]
    of_numbers = [name for name in lacking if name.startswith(OF_NUMBERS) and name != "sse4a"]
    if of_numbers:
        raise InvalidInput(
            f"$LIEMECH_CPU={requested}: this processor, {llvm.get_host_cpu_name()}, lacks its instructions "
            f"{', '.join(sorted(of_numbers))}; name an older one, or native"
        )
    return requested, ",".join(["+64bit", *[f"-{name}" for name in sorted(lacking)]]), _width(instructions)


OF_NUMBERS = "sse", "ssse", "avx", "fma", "bmi", "lzcnt", "popcnt", "movbe", "f16c", "xop"
"""How LLVM's names of those instructions begin with which code for numbers is made."""


def _width(instructions: Sequence[str]) -> int:
    """The doubles that a vector register holds where there are these instructions."""
    return 8 if "avx512f" in instructions else 4 if "avx2" in instructions else 2


def _instructions(processor: str, names: Sequence[str]) -> list[str]:
    """The instructions, of these, that a processor of 64 bits has; none if LLVM does not know it.  LLVM
    copies a function into one for another processor only if that has all instructions of the first.
    """
    _prepare()
    pairs = "".join(
        f"define internal void @inner{i}() #{i + 1} {{\n  fence seq_cst\n  ret void\n}}\n"
        f"define void @outer{i}() #0 {{\n  call void @inner{i}()\n  ret void\n}}\n"
        f'attributes #{i + 1} = {{ "target-features"="+{name}" }}\n'
        for i, name in enumerate(names)
    )
    module = llvm.parse_assembly(pairs + f'attributes #0 = {{ "target-cpu"="{processor}" "target-features"="+64bit" }}')
    simplest = llvm.Target.from_triple(triple()).create_target_machine(cpu="x86-64")
    _pass(module, simplest, 2)
    left = str(module)
    return [name for i, name in enumerate(names) if f"@inner{i}(" not in left]


@functools.cache
def triple() -> str:
    """The platform, in LLVM's words."""
    with _lock:
        return llvm.get_process_triple()


def width() -> int:
    """The doubles that a vector register of the processor holds."""
    return processor()[2]


def object_code(text: str) -> bytes:
    """The machine code for a module in LLVM's language."""
    with _lock:
        return _target().emit_object(_optimised(text))


def portable(texts: Sequence[str], target: str | None) -> tuple[bytes, str, str, str]:
    """Machine code of modules for other programs, the modules as one after LLVM's passes, and the
    platform and processor.

    target : None for the simplest processor of this platform; "native" for this one; LLVM's name of
    a platform, and a processor behind a colon if it is not the simplest: "aarch64-linux-gnu:cortex-a72".
    Raises NotCompilable for others, and such as have no addresses of 64 bits.
    """
    with _lock:
        triple_of, _, processor = (target or triple()).partition(":")
        features = ""
        if target == "native":
            triple_of, processor = triple(), llvm.get_host_cpu_name()
            features = llvm.get_host_cpu_features().flatten()
        _prepare_all()
        try:
            machine = llvm.Target.from_triple(triple_of).create_target_machine(
                cpu=processor, features=features, opt=3, reloc="pic", codemodel="default"
            )
        except RuntimeError as error:
            raise NotCompilable(
                f'Plan.export: LLVM knows no target {target!r}, such as "aarch64-linux-gnu:cortex-a72": {error}'
            ) from None
        if "p:32:32" in (data := str(machine.target_data)) or "-p:16" in data:
            raise NotCompilable(f"Plan.export: {target!r} has no addresses of 64 bits")
        this_platform = f'target triple = "{triple()}"'
        first, *others = [
            llvm.parse_assembly(text.replace(this_platform, f'target triple = "{triple_of}"')) for text in texts
        ]
        for other in others:
            first.link_in(other)
        first.verify()
        _pass(first, machine, 2)
        return machine.emit_object(first), str(first), triple_of, processor or "generic"


def assembly(text: str) -> str:
    """The machine code as text, for those who want to see what became of a formula."""
    with _lock:
        return str(_target().emit_assembly(_optimised(text)))


def optimised(text: str) -> str:
    """The module after LLVM's passes, in its language."""
    with _lock:
        return str(_optimised(text))


def linked(code: bytes, signature: Any = SIGNATURE) -> tuple[Any, Any]:
    """The owner of the code, and the function; it lives as long as its owner."""
    with _lock:
        library = llvm.JITLibraryBuilder().add_object_img(code).export_symbol("kernel")
        definitions = callbacks.definitions(code)
        if definitions:
            library.add_object_img(object_code(definitions))
        for name, address in (_functions() | callbacks.in_memory(code)).items():
            library.import_symbol(name, address)
        loaded = library.link(_linker(), f"kernel {next(_numbers)}")
        owner = Owner()
        weakref.finalize(owner, _unload, loaded).atexit = False
        return owner, signature(loaded["kernel"])


class Owner:
    """Owns machine code, which goes when this does: under the lock, so that no fork meets LLVM at it."""


def _unload(loaded: Any) -> None:
    with _lock:
        loaded.close()


@functools.cache
def _linker() -> Any:
    """Loads object code: code and constants into one piece of memory, as the small code model wants it."""
    return llvm.create_lljit_compiler(_target_machine(), use_jit_link=NEAR)


def _optimised(text: str) -> Any:
    module = llvm.parse_assembly(text)
    module.verify()
    _pass(module, _target(), 2 if size(text) < LONG else 1)
    return module


def _pass(module: Any, machine: Any, level: int) -> None:
    """Run LLVM's optimizing passes on a module, in place."""
    tuning = llvm.create_pipeline_tuning_options(speed_level=level)
    # lanes are explicit; formulas are scalar on purpose
    tuning.loop_vectorization = tuning.slp_vectorization = False
    passes = llvm.create_pass_builder(machine, tuning)
    copying = llvm.create_new_module_pass_manager()
    copying.add_always_inliner_pass()
    for manager in (copying, passes.getModulePassManager()):
        manager.run(module, passes)
        _released(manager)


def _released(manager: Any) -> None:
    """Free the passes of a manager, and the tables of what they have seen: of llvmlite's classes the
    one whose `_dispose` does nothing comes first, so that nobody else does.
    """
    llvm.newpassmanagers.NewPassManager._dispose(manager)
    manager.detach()


def size(text: str) -> int:
    """The instructions of a module, in its first line: copies that are still to be made count."""
    return int(text.split(maxsplit=2)[1])


@functools.cache
def _target() -> Any:
    """The target machine of the processor that code is made for."""
    return _target_machine()


def _target_machine() -> Any:
    _prepare()
    addresses = {"codemodel": "small", "reloc": "pic"} if NEAR else {}
    name, instructions, _ = processor()
    return llvm.Target.from_triple(triple()).create_target_machine(
        cpu=name, features=instructions, opt=3, jit=True, **addresses
    )


@functools.cache
def _prepare() -> None:
    """Prepare LLVM for this processor, once in a process."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()


@functools.cache
def _prepare_all() -> None:
    """Prepare LLVM for all processors, once in a process."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()


@functools.cache
def _functions() -> dict[str, int]:
    """The functions of the C library that plain Python uses too, under names that LLVM does not
    know, so that it changes nothing about them; and those of Python's that are asked.
    """
    library = c_library()
    of_c = {
        f"liemech_{f.__name__}": ctypes.cast(getattr(library, f.__name__), ctypes.c_void_p).value or 0
        for f in (*LIBM, pow)
    }
    of_c["liemech_sleep"], of_c["liemech_yield"] = _pauses(library)
    return of_c | callbacks.addresses() | interrupts.addresses()


def _pauses(library: Any) -> list[int]:
    """The addresses of the functions by which a thread sleeps for some microseconds, and by which it lets others that
    wait have its processor.
    """
    if os.name == "nt":
        functions = [ctypes.windll.kernel32.SwitchToThread] * 2  # type: ignore[attr-defined]
    else:
        functions = [library.usleep, library.sched_yield]
    return [ctypes.cast(f, ctypes.c_void_p).value or 0 for f in functions]


def c_library() -> ctypes.CDLL:
    """The C library whose functions plain Python uses too."""
    if os.name == "nt":
        return ctypes.CDLL("ucrtbase")
    process = ctypes.CDLL(None)
    if hasattr(process, "sin"):
        return process
    from ctypes.util import find_library

    return ctypes.CDLL(find_library("m"))
