//! The table of check results: a row for each check, a column for each image.

use anstyle::{AnsiColor, Style};
use ser_console::Harmless;

use crate::check::Checked;
use crate::checks::Outcome;

const KEPT: Style = AnsiColor::Green.on_default();
const BROKEN: Style = AnsiColor::Red.on_default().bold();
const FAINT: Style = Style::new().dimmed();

/// The table, the faults and the places of the images, with colours.
#[must_use]
pub fn table(images: &[Checked]) -> String {
    lines(images).join("\n") + "\n"
}

fn lines(images: &[Checked]) -> Vec<String> {
    let mut lines = vec![String::new()];
    let Some(first) = images.first() else { return lines };
    let label = width(first.outcomes.iter().map(|outcome| outcome.what));
    let widths: Vec<usize> = images.iter().map(column_width).collect();
    let heads =
        images.iter().zip(&widths).map(|(image, width)| format!("  {:<width$}", image.board));
    lines.push(trimmed(&heads.fold(format!("{:label$}", ""), |line, head| line + "  " + &head)));
    for (row, outcome) in first.outcomes.iter().enumerate() {
        let cells = images.iter().zip(&widths);
        let cells = cells.filter_map(|(image, width)| Some(cell(image.outcomes.get(row)?, *width)));
        lines.push(trimmed(
            &cells.fold(format!("{:label$}", outcome.what), |line, cell| line + "  " + &cell),
        ));
    }
    // Names of functions and files may hold anything.
    for Checked { board, outcomes, .. } in images {
        for outcome in outcomes.iter().filter(|outcome| !outcome.wrong.is_empty()) {
            lines.push(format!("\n{BROKEN}{board}, {}:{BROKEN:#}", outcome.what));
            lines.extend(outcome.wrong.iter().map(|wrong| format!("  {}", Harmless(wrong).line())));
        }
    }
    lines.push(String::new());
    let files = images.iter().map(|image| Harmless(image.file.display()).line());
    lines.extend(files.map(|file| format!("{FAINT}{file}{FAINT:#}")));
    lines
}

fn cell(outcome: &Outcome, width: usize) -> String {
    let (style, mark) = match outcome {
        Outcome { wrong, .. } if !wrong.is_empty() => (BROKEN, "✗"),
        Outcome { result, .. } if result.is_empty() => {
            return format!("{FAINT}–{FAINT:#} {:width$}", "");
        }
        _ => (KEPT, "✓"),
    };
    format!("{style}{mark}{style:#} {:width$}", outcome.result)
}

fn column_width(image: &Checked) -> usize {
    width(image.outcomes.iter().map(|outcome| &*outcome.result).chain([image.board]))
}

fn width<'a>(texts: impl Iterator<Item = &'a str>) -> usize {
    texts.map(|text| text.chars().count()).max().unwrap_or(0)
}

fn trimmed(line: &str) -> String {
    line.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn outcome(what: &'static str, result: &str, wrong: &[&str]) -> Outcome {
        Outcome {
            what,
            result: result.to_owned(),
            wrong: wrong.iter().map(|&line| line.to_owned()).collect(),
        }
    }

    fn image(board: &'static str, file: &str, outcomes: Vec<Outcome>) -> Checked {
        let (file, stack_paths) = (PathBuf::from(file), String::new());
        Checked { board, file, outcomes, stack_bytes: None, stack_paths }
    }

    fn shown(images: &[Checked]) -> String {
        anstream::adapter::strip_str(&table(images)).to_string()
    }

    #[test]
    fn a_row_for_each_check_and_what_is_wrong_below() {
        let first = vec![outcome("flash", "21.7 of 48.0 KiB", &[]), outcome("in RAM", "", &[])];
        let second =
            vec![outcome("flash", "9.0 KiB", &[]), outcome("in RAM", "1 way", &["f is in flash"])];
        let images = [image("mps2-an385", "a.elf", first), image("stm32f407", "b.elf", second)];
        let expected = "
          mps2-an385          stm32f407
flash   ✓ 21.7 of 48.0 KiB  ✓ 9.0 KiB
in RAM  –                   ✗ 1 way

stm32f407, in RAM:
  f is in flash

a.elf
b.elf
";
        assert_eq!(shown(&images), expected);
    }

    #[test]
    fn what_a_terminal_would_obey_in_names_is_shown() {
        let outcomes = vec![outcome("in RAM", "1 way", &["f\u{1b}[2J\nmain is in flash"])];
        let text = table(&[image("board", "a\u{1b}[2J\n.elf", outcomes)]);
        assert!(
            text.contains(r"f\u{1b}[2J\nmain is") && text.contains(r"a\u{1b}[2J\n.elf"),
            "{text}"
        );
    }
}
