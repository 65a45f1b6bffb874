//! What the recorder keeps without power, as it is in force, and the memory behind it.

use ser_proto::{Configuration, InputFilter};

use crate::kept::{FILTERS, Kept, RECORD_LEN};
use crate::settings::{NotStored, Settings, Storage};

/// What is in force, whether or not it could be stored.
pub(crate) struct Keeper<'a, S> {
    settings: Settings<'a, S>,
    kept: Kept,
    /// Whether the memory held all of it when that was tried last; `None` before the first time.
    is_stored: Option<bool>,
}

impl<'a, S: Storage> Keeper<'a, S> {
    /// Loads what was stored, and counts this power-up, which begins a life of the log.
    pub(crate) fn power_up(storage: S, record: &'a mut [u8; RECORD_LEN]) -> Keeper<'a, S> {
        let (settings, mut kept) = Settings::load(storage, record);
        kept.power_ups = kept.power_ups.saturating_add(1);
        kept.lives = kept.lives.saturating_add(1);
        Keeper { settings, kept, is_stored: None }
    }

    pub(crate) const fn configuration(&self) -> &Configuration {
        &self.kept.configuration
    }

    pub(crate) fn set_configuration(&mut self, configuration: Configuration) {
        self.kept.configuration = configuration;
    }

    /// The filters by input; `None` if no host has ever set one.
    pub(crate) const fn filters(&self) -> Option<&[InputFilter; FILTERS]> {
        self.kept.filters.as_ref()
    }

    pub(crate) fn set_filters(&mut self, filters: [InputFilter; FILTERS]) {
        self.kept.filters = Some(filters);
    }

    /// Power-ups so far, this one included.
    pub(crate) const fn power_ups(&self) -> u32 {
        self.kept.power_ups
    }

    /// The life of the log.
    pub(crate) const fn life(&self) -> u32 {
        self.kept.lives
    }

    /// Another life of the log begins.
    pub(crate) fn begin_life(&mut self) {
        self.kept.lives = self.kept.lives.saturating_add(1);
    }

    /// Whether power-ups and lives go on counting at the next power-up.
    pub(crate) fn counts_last(&self) -> bool {
        self.is_stored == Some(true)
    }

    /// Whether nothing was stored since power-up.
    pub(crate) const fn is_new(&self) -> bool {
        self.is_stored.is_none()
    }

    /// Stores what is in force, unless the memory holds it already.
    pub(crate) fn keep(&mut self) -> Result<(), NotStored> {
        let stored =
            if self.settings.holds(&self.kept) { Ok(()) } else { self.settings.save(&self.kept) };
        self.is_stored = Some(stored.is_ok());
        stored
    }
}
