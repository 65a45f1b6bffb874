//! What is simulated, and how: the recorder and what plays it, its port, its contacts, and its bus.

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
    /// What plays the recorder.
    pub backend: Backend,
    /// The Genius bus, if the recorder is on one. `model` is then ignored. The bus's first recorder
    /// is played by `backend` and has the port; the others are built in.
    pub genius: Option<GeniusOptions>,
    /// Called with a sentence for the user when something is wrong but the simulator goes on.
    pub notice: Option<Notice>,
    /// Whether to keep what [`Simulator::played`](crate::Simulator::played) returns. The memory it
    /// takes grows with every move, as long as the simulator runs.
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
    /// A native recorder on `port` with still contacts.
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

/// What plays the recorder.
#[derive(Clone, Debug)]
pub enum Backend {
    /// The recorder itself, in this process.
    Native {
        /// How fast its bytes leave it.
        line_rate: LineRate,
        /// Its memory and clock. Keep a clone to give the next simulator the same recorder.
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
    /// a recorder that is given the same file again remembers them. `None` makes a temporary one.
    pub memory: Option<PathBuf>,
    /// File for what the image logs on its second serial port. `None` drops it.
    pub log: Option<PathBuf>,
    /// The emulator; `None` is `qemu-system-arm`.
    pub program: Option<PathBuf>,
}

impl EmulatorOptions {
    /// `image` in the installed QEMU, with temporary memory and no log.
    #[must_use]
    pub fn new(image: impl Into<PathBuf>) -> EmulatorOptions {
        EmulatorOptions { image: image.into(), memory: None, log: None, program: None }
    }

    /// Checks that the image is a file that can be read, because the emulator's own message for one
    /// that is not is less clear.
    ///
    /// # Errors
    /// When it is not.
    pub fn check_image(&self) -> Result<(), SimError> {
        let opened = open_regular(&self.image).map(drop);
        opened.map_err(SimError::io(format!("open the image {}", self.image.display())))
    }
}

/// Opens a regular file to read it, and refuses anything that could block, such as a pipe.
fn open_regular(path: &Path) -> io::Result<File> {
    let mut options = File::options();
    #[cfg(unix)]
    options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    let file = options.read(true).open(path)?;
    let no_file = || io::Error::new(ErrorKind::InvalidInput, "it is not a regular file");
    if file.metadata()?.is_file() { Ok(file) } else { Err(no_file()) }
}
