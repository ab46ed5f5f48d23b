"""Seals: what is written before anybody looks, so that everybody can see afterwards that nothing was changed."""

from __future__ import annotations

import hashlib
import json
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pipeline import __version__
from pipeline.core.errors import MissingFileError, StoreError, UnavailableError
from pipeline.store.atomic import write_atomically
from pipeline.store.results import plain

SEAL, VERDICTS, VERDICT_SEAL, PLAN = "seal.json", "verdicts.json", "verdicts.seal.json", "plan.json"
TRUTH, LOCKED, KEY, OPENED = "truth.json", "truth.fernet", "key", "opened.json"
BUNDLES = "bundles"
SALT = 32  # bytes


def vault_of(out: Path) -> Path:
    """OUT.vault, beside OUT."""
    out = Path(out).resolve()
    return out.with_name(out.name + ".vault")


def digest(content: bytes) -> str:
    """SHA-256 in hexadecimal, as `sha256sum` prints it."""
    return hashlib.sha256(content).hexdigest()


def canonical(value: Any) -> bytes:
    """JSON text of a value, the same bytes for the same value."""
    return (json.dumps(plain(value), indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()


def salted(table: Mapping[str, Any]) -> bytes:
    """A truth table as it is sealed: with a random salt in it, so that nobody can guess it from its digest."""
    return canonical({"salt": secrets.token_hex(SALT)} | dict(table))


def file_digests(folder: Path) -> dict[str, str]:
    """Digest of every file below a folder, by its path in it."""
    files = sorted(path for path in Path(folder).rglob("*") if path.is_file() and not path.name.startswith("."))
    return {path.relative_to(folder).as_posix(): digest(path.read_bytes()) for path in files}


def code_digest() -> str:
    """Digest of the whole package's source: which code judged."""
    root = Path(__file__).resolve().parents[2]
    suffixes = {".py", ".cpp", ".h", ".hpp", ".json", ".so", ".npz"}
    parts = {n: d for n, d in file_digests(root).items() if Path(n).suffix in suffixes}
    return digest(canonical(parts))


def lock(content: bytes, vault: Path) -> None:
    """Encrypt the truth into the vault; its key lies there too, for `open` alone."""
    key = _fernet().generate_key()
    write_atomically(vault / KEY, key)
    write_atomically(vault / LOCKED, _fernet()(key).encrypt(content))


def unlock(vault: Path) -> bytes:
    """The sealed truth of a vault.

    Raises
    ------
    StoreError
        where it cannot be decrypted: a byte was changed
    """
    try:
        key, locked = (vault / KEY).read_bytes(), (vault / LOCKED).read_bytes()
    except FileNotFoundError as error:
        raise MissingFileError(f"{error.filename} does not exist: it is written by blind-check make") from None
    try:
        content: bytes = _fernet()(key).decrypt(locked)
    except Exception as error:
        raise StoreError(f"{vault / LOCKED} or its key was changed after it was sealed: it cannot be opened") from error
    return content


def write_seal(out: Path, truth: bytes, vault: Path | None, more: Mapping[str, Any]) -> None:
    """Seal truth and bundles; the same seal lies in OUT, in the open, and in the vault."""
    seal = {
        "version": __version__,
        "truth_sha256": digest(truth),
        "plan_sha256": digest((out / PLAN).read_bytes()) if (out / PLAN).exists() else None,
        "bundles_sha256": file_digests(out / BUNDLES),
        **more,
    }
    for folder in (out, *([] if vault is None else [vault])):
        write_atomically(folder / SEAL, canonical(seal))


def read_json(path: Path) -> dict[str, Any]:
    """A JSON object of a file; refuses one that is missing or damaged."""
    try:
        found = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        raise MissingFileError(f"{path} does not exist: run the step of blind-check that makes it first") from None
    except ValueError as error:
        raise StoreError(f"{path} is damaged: {error}") from error
    if not isinstance(found, dict):
        raise StoreError(f"{path} is damaged: it holds no table")
    return found


def broken_seals(out: Path, vault: Path | None, truth: bytes) -> list[str]:
    """What is no longer as it was sealed, one sentence each."""
    seal, found = read_json(out / SEAL), []
    if vault is not None and (vault / SEAL).exists() and (vault / SEAL).read_bytes() != (out / SEAL).read_bytes():
        found.append(f"{SEAL} in OUT is not the one in the vault")
    if digest(truth) != seal["truth_sha256"]:
        found.append("the truth table is not the one that was sealed")
    if seal.get("plan_sha256") and digest((out / PLAN).read_bytes()) != seal["plan_sha256"]:
        found.append(f"{PLAN} was changed after it was sealed")
    sealed, now = seal["bundles_sha256"], file_digests(out / BUNDLES)
    for name in sorted(sealed.keys() | now.keys()):
        if sealed.get(name) != now.get(name):
            found.append(f"{BUNDLES}/{name} was changed, added or lost after it was sealed")
    verdict = read_json(out / VERDICT_SEAL)
    if digest((out / VERDICTS).read_bytes()) != verdict["verdicts_sha256"]:
        found.append(f"{VERDICTS} was changed after it was sealed")
    if verdict["seal_sha256"] != digest((out / SEAL).read_bytes()):
        found.append("the verdicts were made for another seal of bundles and truth")
    return found


def _fernet() -> Any:
    try:
        from cryptography.fernet import Fernet
    except ImportError as error:
        raise UnavailableError(
            "blind-check needs the package cryptography to lock the truth: pip install cryptography"
        ) from error
    return Fernet
