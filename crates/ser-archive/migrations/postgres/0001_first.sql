-- What this archive is. The position is that of the row that was added last, of whatever table:
-- positions rise in the order in which rows were committed.
CREATE TABLE archive (
    one BIGINT PRIMARY KEY CHECK (one = 1),
    schema BIGINT NOT NULL,
    readable_by BIGINT NOT NULL,
    program TEXT NOT NULL,
    position BIGINT NOT NULL
);

CREATE TABLE recorder (
    id BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    name TEXT NOT NULL UNIQUE
);

-- What one collector has added of one recorder is a chain of digests.
CREATE TABLE chain (
    id BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    collector TEXT NOT NULL,
    recorder BIGINT NOT NULL REFERENCES recorder (id),
    UNIQUE (collector, recorder)
);

-- The digest of a chain after everything that was added at once, and how many rows it has by then.
CREATE TABLE link (
    chain BIGINT NOT NULL REFERENCES chain (id),
    position BIGINT NOT NULL,
    rows BIGINT NOT NULL,
    archived_us BIGINT NOT NULL,
    digest BYTEA NOT NULL,
    PRIMARY KEY (chain, position)
);

-- Recorder, life and sequence are what an entry is. The stamp is its eight bytes as they were read,
-- and `shown_us` the same in microseconds since 1970 by the recorder's clock, if it is a time at all.
-- There are so many that their chain and recorder are checked when the archive is verified, and not by
-- the database with each row.
CREATE TABLE entry (
    position BIGINT PRIMARY KEY,
    chain BIGINT NOT NULL,
    recorder BIGINT NOT NULL,
    life BIGINT NOT NULL,
    sequence BIGINT NOT NULL,
    number BIGINT NOT NULL,
    stamp BIGINT NOT NULL,
    shown_us BIGINT,
    changed BIGINT NOT NULL,
    state BIGINT NOT NULL,
    known BIGINT NOT NULL
);

CREATE UNIQUE INDEX entry_by_place ON entry (recorder, life, sequence);
CREATE INDEX entry_by_shown ON entry (recorder, shown_us);

-- What contradicts an entry: the same place with other content. Both are kept.
CREATE TABLE conflict (
    position BIGINT PRIMARY KEY,
    chain BIGINT NOT NULL,
    recorder BIGINT NOT NULL,
    life BIGINT NOT NULL,
    sequence BIGINT NOT NULL,
    number BIGINT NOT NULL,
    stamp BIGINT NOT NULL,
    shown_us BIGINT,
    changed BIGINT NOT NULL,
    state BIGINT NOT NULL,
    known BIGINT NOT NULL
);

CREATE INDEX conflict_by_place ON conflict (recorder, life, sequence);

-- Every other record, as the line of JSON that says it: gaps, lives, what clocks showed, where they
-- may have been set, what was watched, names. The content is the SHA-256 of that line.
CREATE TABLE evidence (
    position BIGINT PRIMARY KEY,
    chain BIGINT NOT NULL REFERENCES chain (id),
    recorder BIGINT NOT NULL REFERENCES recorder (id),
    kind TEXT NOT NULL,
    life BIGINT NOT NULL,
    line TEXT NOT NULL,
    content BYTEA NOT NULL,
    UNIQUE (recorder, content)
);

CREATE INDEX evidence_by_kind ON evidence (kind, recorder, life);
CREATE INDEX evidence_by_chain ON evidence (chain, position);

-- Where a collector goes on reading a recorder. It moves in the transaction that holds what was read
-- up to there.
CREATE TABLE bookmark (
    chain BIGINT PRIMARY KEY REFERENCES chain (id),
    life BIGINT NOT NULL,
    sequence BIGINT NOT NULL,
    exact BIGINT NOT NULL,
    log_size BIGINT,
    stamp BIGINT,
    changed BIGINT,
    state BIGINT,
    log BYTEA NOT NULL
);

-- A life as one collector calls it, and as it is filed: another collector may have read the same log
-- before and given it another name. `shift` is added to the sequences that this collector gives.
CREATE TABLE alias (
    chain BIGINT NOT NULL REFERENCES chain (id),
    life BIGINT NOT NULL,
    joined BIGINT NOT NULL,
    shift BIGINT NOT NULL,
    PRIMARY KEY (chain, life)
);

-- Up to where somebody has been given what is here, and has said that it is safe there. Retention
-- lets nothing go beyond that.
CREATE TABLE outlet (
    name TEXT PRIMARY KEY,
    position BIGINT NOT NULL
);

-- Where rows were let go by retention: those of a chain up to `to_position`. `rows` and `digest` are
-- where the chain was by then, and `kept` is a digest over the evidence that is left of them. `conflicts`
-- counts all that were ever let go of the chain.
CREATE TABLE checkpoint (
    position BIGINT PRIMARY KEY,
    chain BIGINT NOT NULL REFERENCES chain (id),
    to_position BIGINT NOT NULL,
    rows BIGINT NOT NULL,
    digest BYTEA NOT NULL,
    kept BYTEA NOT NULL,
    entries BIGINT NOT NULL,
    conflicts BIGINT NOT NULL,
    expired_us BIGINT NOT NULL
);

CREATE INDEX checkpoint_by_chain ON checkpoint (chain, to_position);
