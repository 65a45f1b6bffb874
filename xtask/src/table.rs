//! The table of what the checks found: a row for each check, a column for each board.

use anstyle::{AnsiColor, Style};

use crate::boards::Board;
use crate::checks::Outcome;

const KEPT: Style = AnsiColor::Green.on_default();
const BROKEN: Style = AnsiColor::Red.on_default().bold();
const FAINT: Style = Style::new().dimmed();

/// The table, what is wrong, and where the images are.
pub(crate) fn lines(columns: &[(&Board, Vec<Outcome>)]) -> Vec<String> {
    let mut lines = vec![String::new()];
    let Some((_, first)) = columns.first() else { return lines };
    let label = width(first.iter().map(|outcome| outcome.what));
    let widths: Vec<usize> = columns.iter().map(column_width).collect();
    let heads = columns.iter().zip(&widths).map(|((board, _), width)| format!("  {:<width$}", board.name));
    lines.push(trimmed(&heads.fold(format!("{:label$}", ""), |line, head| line + "  " + &head)));
    for (row, outcome) in first.iter().enumerate() {
        let cells = columns.iter().zip(&widths);
        let cells = cells.filter_map(|((_, outcomes), width)| Some(cell(outcomes.get(row)?, *width)));
        lines
            .push(trimmed(&cells.fold(format!("{:label$}", outcome.what), |line, cell| line + "  " + &cell)));
    }
    for (board, outcomes) in columns {
        for outcome in outcomes.iter().filter(|outcome| !outcome.wrong.is_empty()) {
            lines.push(format!("\n{BROKEN}{}, {}:{BROKEN:#}", board.name, outcome.what));
            lines.extend(outcome.wrong.iter().map(|wrong| format!("  {wrong}")));
        }
    }
    lines.push(String::new());
    lines.extend(columns.iter().map(|(board, _)| format!("{FAINT}{}{FAINT:#}", board.image().display())));
    lines
}

fn cell(outcome: &Outcome, width: usize) -> String {
    let (style, mark) = match outcome {
        Outcome { wrong, .. } if !wrong.is_empty() => (BROKEN, "✗"),
        Outcome { result, .. } if result.is_empty() => return format!("{FAINT}–{FAINT:#} {:width$}", ""),
        _ => (KEPT, "✓"),
    };
    format!("{style}{mark}{style:#} {:width$}", outcome.result)
}

fn column_width((board, outcomes): &(&Board, Vec<Outcome>)) -> usize {
    width(outcomes.iter().map(|outcome| &*outcome.result).chain([board.name]))
}

fn width<'a>(texts: impl Iterator<Item = &'a str>) -> usize {
    texts.map(|text| text.chars().count()).max().unwrap_or(0)
}

fn trimmed(line: &str) -> String {
    line.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boards::BOARDS;

    fn outcome(what: &'static str, result: &str, wrong: &[&str]) -> Outcome {
        Outcome {
            what,
            result: result.to_owned(),
            wrong: wrong.iter().map(|&line| line.to_owned()).collect(),
        }
    }

    #[test]
    fn a_row_for_each_check_and_what_is_wrong_below() {
        let [first, second] = &BOARDS;
        let columns = [
            (first, vec![outcome("flash", "21.7 of 48.0 KiB", &[]), outcome("in RAM", "", &[])]),
            (second, vec![outcome("flash", "9.0 KiB", &[]), outcome("in RAM", "1 way", &["f is in flash"])]),
        ];
        let text = lines(&columns[..]).join("\n");
        let plain = anstream::adapter::strip_str(&text).to_string();
        let expected = "
          mps2-an385          stm32f407
flash   ✓ 21.7 of 48.0 KiB  ✓ 9.0 KiB
in RAM  –                   ✗ 1 way

stm32f407, in RAM:
  f is in flash

";
        assert!(plain.starts_with(expected), "{plain}");
    }
}
