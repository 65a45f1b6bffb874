//! The few styles in use, and none where colour is not wanted.

use anstyle::{AnsiColor, Style};

/// The styles of the output.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Palette {
    /// Column titles.
    pub(crate) title: Style,
    /// Details that are seldom needed.
    pub(crate) faint: Style,
    /// An input that went on.
    pub(crate) on: Style,
    /// What needs attention: lost events, damage.
    pub(crate) alarm: Style,
    /// The event that started an incident.
    pub(crate) first_out: Style,
    /// A command that the user could type.
    pub(crate) command: Style,
}

impl Palette {
    /// No styles.
    pub(crate) fn plain() -> Palette {
        Palette::default()
    }

    /// Styles if standard output is a terminal that supports them and the user does not object.
    pub(crate) fn of_stdout() -> Palette {
        match anstream::AutoStream::choice(&std::io::stdout()) {
            anstream::ColorChoice::Never => Palette::plain(),
            _ => Palette::coloured(),
        }
    }

    fn coloured() -> Palette {
        let color = |color: AnsiColor| Style::new().fg_color(Some(color.into()));
        Palette {
            title: Style::new().bold(),
            faint: Style::new().dimmed(),
            on: Style::new().bold(),
            alarm: color(AnsiColor::Yellow).bold(),
            first_out: color(AnsiColor::Red).bold(),
            command: color(AnsiColor::Cyan),
        }
    }
}
