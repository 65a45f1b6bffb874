//! What a reading of all recorders has brought, as a table.

use std::io::{self, Write};

use ser_collector::{Ended, Reached, State};

use crate::error::Result;
use crate::output::{Grid, Palette};

pub(super) fn write(ended: &Ended) -> Result<()> {
    let rows = ended.states.iter().map(row).collect();
    let columns = vec!["recorder", "new", "losses", "conflicts", "state"];
    let mut out = io::stdout().lock();
    Grid { title: None, columns, rows }.write(&mut out, Palette::of_stdout())?;
    Ok(out.flush()?)
}

fn row(state: &State) -> Vec<String> {
    let unless_none = |count: u64| if count > 0 { count.to_string() } else { String::new() };
    let how = match (state.reached, &state.trouble) {
        (Reached::Done | Reached::Yes, _) => "read".to_owned(),
        (_, Some((trouble, _))) => format!("not read: {trouble}"),
        (_, None) => "not read".to_owned(),
    };
    vec![
        state.recorder.clone(),
        state.entries.to_string(),
        unless_none(state.gaps),
        unless_none(state.conflicts),
        how,
    ]
}
