//! What is simulated, and how: the node and what plays it, its port, its contacts, and its bus.

use std::fmt;
use std::fs::File;
use std::io::{self, ErrorKind};
#[cfg(unix)]
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use ser_proto::Model;

use crate::contacts::source::Contacts;
use crate::error::SimError;
use crate::genius_options::GeniusOptions;
use crate::line::port::Port;
use crate::machine::non_volatile::NonVolatile;
use crate::machine::sim_node::LineRate;

/// What is simulated, and how.
#[derive(Debug)]
pub struct SimOptions {
    /// Which recorder.
    pub model: Model,
    /// Where a host reaches it.
    pub port: Port,
    /// What moves its contacts.
    pub contacts: Contacts,
    /// Debounce time of all inputs; 0 is off.
    pub debounce_ms: u8,
    /// What plays the node.
    pub backend: Backend,
    /// The Genius bus, if the node is on one. Then `model` is of no account, and the bus's first
    /// node is the one that is played by `backend` and has the port; the others are built in.
    pub genius: Option<GeniusOptions>,
    /// Called with a sentence for the user when something is not as it should be but goes on.
    pub notice: Option<Notice>,
    /// Whether [`Simulator::played`](crate::Simulator::played) is wanted. It takes memory with
    /// every move, as long as the simulator runs.
    pub keep_played: bool,
}

/// Takes a sentence for the user.
pub struct Notice(pub Box<dyn Fn(&str) + Send>);

impl fmt::Debug for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Notice")
    }
}

impl SimOptions {
    /// A native node on `port` with still contacts.
    #[must_use]
    pub fn new(model: Model, port: Port) -> SimOptions {
        SimOptions {
            model,
            port,
            contacts: Contacts::None,
            debounce_ms: 0,
            backend: Backend::default(),
            genius: None,
            notice: None,
            keep_played: false,
        }
    }
}

/// What plays the node.
#[derive(Clone, Debug)]
pub enum Backend {
    /// The recorder itself, in this process.
    Native {
        /// How fast its bytes leave it.
        line_rate: LineRate,
        /// Its memory and clock; keep a clone and the next simulator has the same node.
        non_volatile: NonVolatile,
    },
    /// The ARM image, in QEMU.
    Emulator(EmulatorOptions),
}

impl Default for Backend {
    fn default() -> Self {
        Backend::Native { line_rate: LineRate::Unlimited, non_volatile: NonVolatile::new() }
    }
}

/// The emulated board.
#[derive(Clone, Debug)]
pub struct EmulatorOptions {
    /// The image, an ELF file for `mps2-an385`.
    pub image: PathBuf,
    /// File behind the board's external memory. It holds the stored configuration and the time, so
    /// a node that is given the same file again remembers them. `None` makes a temporary one.
    pub memory: Option<PathBuf>,
    /// File for what the image logs on its second serial port. `None` drops it.
    pub log: Option<PathBuf>,
    /// The emulator; `qemu-system-arm` when `None`.
    pub program: Option<PathBuf>,
}

impl EmulatorOptions {
    /// `image` in the installed QEMU, with temporary memory and no log.
    #[must_use]
    pub fn new(image: impl Into<PathBuf>) -> EmulatorOptions {
        EmulatorOptions { image: image.into(), memory: None, log: None, program: None }
    }

    /// Looks whether the image is a file that can be read: the emulator's own words for one that is
    /// not are less clear.
    ///
    /// # Errors
    /// When it is none.
    pub fn check_image(&self) -> Result<(), SimError> {
        let opened = open_regular(&self.image).map(drop);
        opened.map_err(SimError::io(format!("open the image {}", self.image.display())))
    }
}

/// Opens a file to read it, and nothing that would have to be waited for, as a pipe.
fn open_regular(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    #[cfg(unix)]
    options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    let file = options.read(true).open(path)?;
    let no_file = || io::Error::new(ErrorKind::InvalidInput, "it is not a regular file");
    if file.metadata()?.is_file() { Ok(file) } else { Err(no_file()) }
}
