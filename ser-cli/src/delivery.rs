//! Where deliveries go: events to standard output, losses to where they are seen, the rest to the progress bar.

use std::fmt::Display;

use ser_client::{Delivery, Lost};

use crate::error::{Result, warn};
use crate::output::{self, EventWriter, Format};
use crate::progress::Progress;

/// Writes what a reading brings.
pub(crate) struct Outlet {
    writer: Box<dyn EventWriter>,
    progress: Progress,
}

impl Outlet {
    /// On standard output, with a bar if the download is long.
    pub(crate) fn new(format: Format) -> Outlet {
        Outlet { writer: output::to_stdout(format), progress: Progress::new() }
    }

    /// On standard output, without a bar: there is no end to wait for.
    pub(crate) fn endless(format: Format) -> Outlet {
        Outlet { writer: output::to_stdout(format), progress: Progress::none() }
    }

    /// Writes deliveries and passes them on; `pending` more events are about to come.
    pub(crate) fn take(&mut self, deliveries: &[Delivery], pending: u32) -> Result<()> {
        self.progress.advance(deliveries, pending);
        let Outlet { writer, progress } = self;
        progress.around(|| write(writer.as_mut(), deliveries))
    }

    /// Passes on what is due also when nothing was delivered, such as the header of a file.
    pub(crate) fn finish(&mut self) -> Result<()> {
        self.progress.finish();
        Ok(self.writer.flush()?)
    }
}

fn write(writer: &mut dyn EventWriter, deliveries: &[Delivery]) -> Result<()> {
    if deliveries.is_empty() {
        return Ok(());
    }
    for (position, delivery) in deliveries.iter().enumerate() {
        match delivery {
            Delivery::Event { entry_number, entry, .. } => writer.event(*entry_number, entry)?,
            Delivery::Lost(lost) => {
                let text = lost_text(*lost);
                writer.lost(&text)?;
                warn(
                    place(&deliveries[position..])
                        .map_or(text.clone(), |entry| format!("before entry {entry}: {text}")),
                );
            }
        }
    }
    Ok(writer.flush()?)
}

/// The entry that comes first after a loss.
fn place(deliveries: &[Delivery]) -> Option<impl Display> {
    deliveries.iter().find_map(|delivery| match delivery {
        Delivery::Event { entry_number, .. } => Some(*entry_number),
        Delivery::Lost(_) => None,
    })
}

fn lost_text(lost: Lost) -> String {
    let events =
        |count: u32| if count == 1 { "1 event was".to_string() } else { format!("{count} events were") };
    match lost {
        Lost::Overwritten { count } => format!("{} overwritten before they were read", events(count)),
        Lost::OverwrittenAtLeast { count } => {
            format!("{} overwritten already (or a multiple of 65536 more)", events(count))
        }
        Lost::LogRestarted => {
            "the log began anew (erased, or no power); what was unread then is lost, how many is not known"
                .to_string()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_loss_is_exact_where_it_can_be() {
        assert_eq!(
            lost_text(Lost::Overwritten { count: 37 }),
            "37 events were overwritten before they were read"
        );
        assert!(lost_text(Lost::Overwritten { count: 1 }).starts_with("1 event was "));
        assert!(lost_text(Lost::OverwrittenAtLeast { count: 9 }).contains("multiple of 65536 more"));
        assert!(lost_text(Lost::LogRestarted).contains("not known"));
    }
}
