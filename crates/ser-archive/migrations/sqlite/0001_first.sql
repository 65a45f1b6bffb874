-- What this archive is. The position is that of the row that was added last, of whatever table:
-- positions rise in the order in which rows were committed.
CREATE TABLE archive (
    one INTEGER PRIMARY KEY CHECK (one = 1),
    schema INTEGER NOT NULL,
    readable_by INTEGER NOT NULL,
    program TEXT NOT NULL,
    position INTEGER NOT NULL
) STRICT;

CREATE TABLE recorder (
    id INTEGER PRIMARY KEY,
    name TEXT NOT NULL UNIQUE
) STRICT;

-- What one collector has added of one recorder is a chain of digests.
CREATE TABLE chain (
    id INTEGER PRIMARY KEY,
    collector TEXT NOT NULL,
    recorder INTEGER NOT NULL REFERENCES recorder (id),
    UNIQUE (collector, recorder)
) STRICT;

-- The digest of a chain after everything that was added at once, and how many rows it has by then.
CREATE TABLE link (
    chain INTEGER NOT NULL REFERENCES chain (id),
    position INTEGER NOT NULL,
    rows INTEGER NOT NULL,
    archived_us INTEGER NOT NULL,
    digest BLOB NOT NULL,
    PRIMARY KEY (chain, position)
) STRICT, WITHOUT ROWID;

-- Recorder, life and sequence are what an entry is. The stamp is its eight bytes as they were read,
-- and `shown_us` the same in microseconds since 1970 by the recorder's clock, if it is a time at all.
-- There are so many that their chain and recorder are checked when the archive is verified, and not by
-- the database with each row.
CREATE TABLE entry (
    position INTEGER PRIMARY KEY,
    chain INTEGER NOT NULL,
    recorder INTEGER NOT NULL,
    life INTEGER NOT NULL,
    sequence INTEGER NOT NULL,
    number INTEGER NOT NULL,
    stamp INTEGER NOT NULL,
    shown_us INTEGER,
    changed INTEGER NOT NULL,
    state INTEGER NOT NULL,
    known INTEGER NOT NULL
) STRICT;

CREATE UNIQUE INDEX entry_by_place ON entry (recorder, life, sequence);
CREATE INDEX entry_by_shown ON entry (recorder, shown_us);

-- What contradicts an entry: the same place with other content. Both are kept.
CREATE TABLE conflict (
    position INTEGER PRIMARY KEY,
    chain INTEGER NOT NULL,
    recorder INTEGER NOT NULL,
    life INTEGER NOT NULL,
    sequence INTEGER NOT NULL,
    number INTEGER NOT NULL,
    stamp INTEGER NOT NULL,
    shown_us INTEGER,
    changed INTEGER NOT NULL,
    state INTEGER NOT NULL,
    known INTEGER NOT NULL
) STRICT;

CREATE INDEX conflict_by_place ON conflict (recorder, life, sequence);

-- Every other record, as the line of JSON that says it: gaps, lives, what clocks showed, where they
-- may have been set, what was watched, names. The content is the SHA-256 of that line.
CREATE TABLE evidence (
    position INTEGER PRIMARY KEY,
    chain INTEGER NOT NULL REFERENCES chain (id),
    recorder INTEGER NOT NULL REFERENCES recorder (id),
    kind TEXT NOT NULL,
    life INTEGER NOT NULL,
    line TEXT NOT NULL,
    content BLOB NOT NULL,
    UNIQUE (recorder, content)
) STRICT;

CREATE INDEX evidence_by_kind ON evidence (kind, recorder, life);
CREATE INDEX evidence_by_chain ON evidence (chain, position);

-- Where a collector goes on reading a recorder. It moves in the transaction that holds what was read
-- up to there.
CREATE TABLE bookmark (
    chain INTEGER PRIMARY KEY REFERENCES chain (id),
    life INTEGER NOT NULL,
    sequence INTEGER NOT NULL,
    exact INTEGER NOT NULL,
    log_size INTEGER,
    stamp INTEGER,
    changed INTEGER,
    state INTEGER,
    log BLOB NOT NULL
) STRICT;

-- A life as one collector calls it, and as it is filed: another collector may have read the same log
-- before and given it another name. `shift` is added to the sequences that this collector gives.
CREATE TABLE alias (
    chain INTEGER NOT NULL REFERENCES chain (id),
    life INTEGER NOT NULL,
    joined INTEGER NOT NULL,
    shift INTEGER NOT NULL,
    PRIMARY KEY (chain, life)
) STRICT, WITHOUT ROWID;

-- Up to where somebody has been given what is here, and has said that it is safe there. Retention
-- lets nothing go beyond that.
CREATE TABLE outlet (
    name TEXT PRIMARY KEY,
    position INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Where rows were let go by retention: those of a chain up to `to_position`. `rows` and `digest` are
-- where the chain was by then, and `kept` is a digest over the evidence that is left of them. `conflicts`
-- counts all that were ever let go of the chain.
CREATE TABLE checkpoint (
    position INTEGER PRIMARY KEY,
    chain INTEGER NOT NULL REFERENCES chain (id),
    to_position INTEGER NOT NULL,
    rows INTEGER NOT NULL,
    digest BLOB NOT NULL,
    kept BLOB NOT NULL,
    entries INTEGER NOT NULL,
    conflicts INTEGER NOT NULL,
    expired_us INTEGER NOT NULL
) STRICT;

CREATE INDEX checkpoint_by_chain ON checkpoint (chain, to_position);
