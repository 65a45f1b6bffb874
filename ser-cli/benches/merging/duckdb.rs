//! `DuckDB`, a database that reads such files by itself.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::files::Format;
use crate::measure::Job;

/// The version that is compared with.
const PACKAGE: &str = "duckdb==2.0.1";

/// Two threads, as `ser-cli` has on two cores.
const SET_UP: &str = "SET threads = 2; SET preserve_insertion_order = false;";

/// A Python that has it.
pub(crate) struct DuckDb {
    python: PathBuf,
}

impl DuckDb {
    /// Sets it up in a virtual environment in this folder, if it is not there yet. `None` if that
    /// fails; the reason is told.
    pub(crate) fn at(folder: &Path) -> Option<DuckDb> {
        let python = folder.join("bin").join("python");
        let has_it = || works(Command::new(&python).args(["-c", "import duckdb"]));
        if !has_it() {
            let made = works(Command::new("python3").args(["-m", "venv"]).arg(folder));
            let _ = made
                && works(Command::new(&python).args(["-m", "pip", "install", "--quiet", PACKAGE]));
        }
        has_it().then_some(DuckDb { python })
    }

    fn job(&self, name: &'static str, query: &str) -> Job {
        let mut command = Command::new(&self.python);
        let script = format!("import duckdb\nduckdb.sql('''{SET_UP}''')\n{query}");
        command.args(["-c", &script]);
        Job { name, command }
    }

    /// All rows by time, written to a file.
    pub(crate) fn merge(&self, format: Format, paths: &[PathBuf], to: &Path) -> Job {
        let query = format!(
            "duckdb.sql('''COPY (SELECT * FROM {} ORDER BY time, recorder, sequence, input)
            TO '{}' (FORMAT csv)''')",
            rows(format, paths),
            to.display()
        );
        self.job("DuckDB, all rows by their time", &query)
    }

    /// The rows after the last five seconds in which there is none.
    pub(crate) fn last_incident(&self, format: Format, paths: &[PathBuf]) -> Job {
        let query = format!(
            "print(duckdb.sql('''WITH rows AS MATERIALIZED (SELECT * FROM {}),
            gaps AS (SELECT time, time - lag(time) OVER (ORDER BY time) AS quiet FROM rows)
            SELECT * FROM rows WHERE time >= (SELECT max(time) FROM gaps
                WHERE quiet IS NULL OR quiet > INTERVAL 5 SECOND)
            ORDER BY time''').fetchall())",
            rows(format, paths)
        );
        self.job("DuckDB, the rows of the last incident", &query)
    }
}

/// A table of all rows. It is told the columns, so that it need not look for them.
fn rows(format: Format, paths: &[PathBuf]) -> String {
    let paths: Vec<String> = paths.iter().map(|path| format!("'{}'", path.display())).collect();
    let paths = paths.join(", ");
    match format {
        Format::Csv | Format::Rows => format!(
            "(SELECT entry, time, input, state, sequence, life, note, filename AS recorder
            FROM read_csv([{paths}], header = true, auto_detect = false, filename = true,
            columns = {{'entry': 'USMALLINT', 'time': 'TIMESTAMP', 'input': 'UTINYINT',
            'state': 'UTINYINT', 'sequence': 'UBIGINT', 'life': 'VARCHAR', 'note': 'VARCHAR'}}))"
        ),
        Format::Jsonl => format!(
            "(SELECT entry, time, input, list_contains(state, input) AS state, sequence, life,
            recorder FROM (SELECT *, unnest(changed) AS input
            FROM read_json([{paths}], format = 'newline_delimited', auto_detect = false,
            columns = {{'record': 'VARCHAR', 'recorder': 'VARCHAR', 'entry': 'USMALLINT',
            'time': 'TIMESTAMP', 'changed': 'UTINYINT[]', 'state': 'UTINYINT[]',
            'sequence': 'UBIGINT', 'life': 'VARCHAR'}}) WHERE record = 'entry'))"
        ),
    }
}

/// Whether it succeeds. What it says about why not is shown.
fn works(command: &mut Command) -> bool {
    command.stdin(Stdio::null()).status().is_ok_and(|status| status.success())
}
