"""Reckons the chains of an archive in a file, by docs/archive.md and nothing else.

Prints a line for each chain: collector, recorder, rows, digest; or where it is broken.
"""

import hashlib
import sqlite3
import struct
import sys


def after(before, row):
    return hashlib.sha256(before + row).digest()


def signed(number):
    return struct.pack(">q", number)


def of_entry(letter, row):
    life, sequence, number, stamp, changed, state, known = row
    masks = struct.pack(">III", changed, state, known)
    return letter + signed(life) + signed(sequence) + struct.pack(">H", number) + signed(stamp) + masks


def rows(archive, chain):
    """All rows of a chain as (position, bytes), in order."""
    found = []
    for table, letter in (("entry", b"E"), ("conflict", b"C")):
        columns = "life, sequence, number, stamp, changed, state, known"
        query = f"SELECT position, {columns} FROM {table} WHERE chain = ?"
        for position, *row in archive.execute(query, (chain,)):
            found.append((position, of_entry(letter, row)))
    for position, line in archive.execute("SELECT position, line FROM evidence WHERE chain = ?", (chain,)):
        found.append((position, b"L" + line.encode()))
    query = "SELECT position, to_position, rows, entries, conflicts, expired_us, digest, kept FROM checkpoint WHERE chain = ?"
    for position, *numbers, digest, kept in archive.execute(query, (chain,)):
        found.append((position, b"K" + b"".join(map(signed, numbers)) + digest + kept))
    return sorted(found)


def main():
    archive = sqlite3.connect(f"file:{sys.argv[1]}?mode=ro", uri=True)
    chains = archive.execute(
        "SELECT chain.id, collector, name FROM chain JOIN recorder ON recorder.id = recorder "
        "ORDER BY collector, name"
    ).fetchall()
    for chain, collector, recorder in chains:
        name = collector.encode()
        begin = b"ser-archive 1\0" + struct.pack(">Q", len(name)) + name + recorder.encode()
        digest, count, start = hashlib.sha256(begin).digest(), 0, 0
        newest = "SELECT to_position, rows, digest, kept FROM checkpoint WHERE chain = ? ORDER BY position DESC"
        checkpoint = archive.execute(newest, (chain,)).fetchone()
        everything = rows(archive, chain)
        if checkpoint:
            start, count, digest, kept = checkpoint
            reckoned = bytes(32)
            for position, row in everything:
                if position <= start:
                    reckoned = after(reckoned, row)
            if reckoned != kept:
                print(f"{collector}\t{recorder}\tbroken before {start}")
                continue
        links = dict(
            (position, (number, noted))
            for position, number, noted in archive.execute(
                "SELECT position, rows, digest FROM link WHERE chain = ?", (chain,)
            )
        )
        broken, good = None, start
        for position, row in everything:
            if position > start:
                digest, count = after(digest, row), count + 1
                noted = links.pop(position, None)
                if noted and noted != (count, digest):
                    broken = broken or position
                elif noted:
                    good = position
        # Every row has a link at its place or behind it, and every link a row.
        rows_end = max((position for position, _ in everything), default=start)
        if broken or good < rows_end or any(position > start for position in links):
            print(f"{collector}\t{recorder}\tbroken after {good}")
        else:
            print(f"{collector}\t{recorder}\t{count}\t{digest.hex()}")


main()
