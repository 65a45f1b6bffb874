//! A serial line over a pseudo-terminal, found under a symbolic link.
//!
//! # Notes
//! We hold the master end. The slave end is open only while a host has it open, so the kernel tells
//! us when there is no host. Bytes then go nowhere, as on a wire, instead of waiting to confuse the
//! next host.
//!
//! A host usually takes the terminal for itself (`TIOCEXCL`), and a host that is killed never gives
//! it back: nobody but root could open the terminal again. The link is then moved to a fresh
//! pseudo-terminal.

use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::mem;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::io::{Errno, FdFlags, fcntl_setfd};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, Termios};
use rustix::{fs as rfs, termios};
use tempfile::TempDir;

use super::Line;
use crate::claim::{Claim, Holder};
use crate::error::SimError;

/// The rate of a port that nobody has set. A factory-fresh recorder uses it, too.
const INITIAL_BITS_PER_SECOND: u32 = 9600;

/// How often the terminal is made ready while no host is there. A host may have come and gone
/// between two looks.
const FREE_EVERY: Duration = Duration::from_millis(100);

pub(crate) struct PtyLine {
    /// Dropped first, so that the link never leads to somebody else's terminal.
    place: Place,
    pair: Pair,
    link: PathBuf,
    published: bool,
    host_present: bool,
    host_changed: bool,
    freed: Instant,
    /// Whether the link is gone because it could not be noted as ours.
    lost: bool,
    /// Whether the link could not be moved when that was last tried.
    failing: bool,
    notices: Vec<String>,
}

/// Where the link is.
enum Place {
    /// A place that others use, too. The link is removed with the claim.
    Shared(Claim),
    /// A directory made for the link alone, because no place was given. It is removed with the
    /// link.
    Own(#[expect(dead_code, reason = "held until the end")] TempDir),
}

impl Place {
    /// Whether what stands there is a link made by us or by a simulator before us. An empty place
    /// is not a link.
    fn holds_ours(&self) -> io::Result<bool> {
        match self {
            Place::Shared(claim) => Ok(claim.holder()? == Holder::Simulator),
            Place::Own(_) => Ok(true),
        }
    }

    /// Notes that the link has just been made.
    fn remember(&self) -> io::Result<()> {
        match self {
            Place::Shared(claim) => claim.remember(),
            Place::Own(_) => Ok(()),
        }
    }
}

/// A pseudo-terminal: the open master and the name of its slave.
struct Pair {
    master: File,
    slave: PathBuf,
}

impl Pair {
    fn new() -> io::Result<Pair> {
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY;
        // Close-on-exec is set in the same step where the system can: a child that inherits the
        // master would keep the terminal alive.
        #[cfg(target_os = "linux")]
        let flags = flags | OpenptFlags::CLOEXEC;
        let master = openpt(flags)?;
        fcntl_setfd(&master, FdFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        rfs::fcntl_setfl(&master, rfs::fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        let slave = PathBuf::from(OsStr::from_bytes(ptsname(&master, Vec::new())?.as_bytes()));
        let pair = Pair { master: File::from(master), slave };
        // The terminal is raw from the start. Otherwise it would echo what the recorder says before
        // a host has set it up.
        let slave = pair.open_slave()?;
        let mut settings: Termios = termios::tcgetattr(&slave)?;
        settings.make_raw();
        settings.set_speed(INITIAL_BITS_PER_SECOND)?;
        termios::tcsetattr(&slave, OptionalActions::Now, &settings)?;
        Ok(pair)
    }

    fn open_slave(&self) -> rustix::io::Result<rustix::fd::OwnedFd> {
        rfs::open(
            &self.slave,
            OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC | OFlags::NONBLOCK,
            Mode::empty(),
        )
    }

    /// Whether anybody has the slave open.
    fn has_host(&self) -> bool {
        let mut descriptors = [PollFd::new(&self.master, PollFlags::IN)];
        match poll(&mut descriptors, Some(&Timespec::default())) {
            Ok(_) => !descriptors[0].revents().contains(PollFlags::HUP),
            Err(_) => true,
        }
    }
}

impl PtyLine {
    pub(crate) fn open(link: Option<&Path>) -> Result<PtyLine, SimError> {
        let (link, place) = match link {
            Some(link) => (link.to_owned(), Place::Shared(claim(link)?)),
            None => {
                let directory = TempDir::with_prefix("ser-sim-")
                    .map_err(SimError::io("make a temporary directory for the pseudo-terminal"))?;
                (directory.path().join("port"), Place::Own(directory))
            }
        };
        let pair = Pair::new().map_err(SimError::io("open a pseudo-terminal"))?;
        Ok(PtyLine {
            place,
            pair,
            link,
            published: false,
            host_present: false,
            host_changed: false,
            freed: Instant::now(),
            lost: false,
            failing: false,
            notices: Vec::new(),
        })
    }

    /// Makes the terminal ready for the next host. Nobody has it open now.
    fn free(&mut self) {
        self.host_present = false;
        self.freed = Instant::now();
        match self.pair.open_slave() {
            Ok(slave) => {
                // The next host finds the terminal free, without the bytes that the last one did
                // not read.
                let _ = termios::ioctl_tiocnxcl(&slave);
                let _ = termios::tcflush(&slave, QueueSelector::IFlush);
            }
            // A host took it for itself and is gone, see the notes above.
            Err(Errno::BUSY) if !self.pair.has_host() => {
                let moved = self.move_to_fresh_terminal();
                self.tell(moved);
            }
            Err(_) => {}
        }
    }

    /// Moves the link to a fresh terminal. When that fails, or when somebody has put something else
    /// in the place of the link, all stays as it is until the next time.
    fn move_to_fresh_terminal(&mut self) -> io::Result<()> {
        if self.published && !self.lost && !self.place.holds_ours()? {
            return Ok(());
        }
        let pair = Pair::new()?;
        if self.published {
            if self.lost {
                symlink(&pair.slave, &self.link)?;
            } else {
                replace_link(&pair.slave, &self.link)?;
            }
            self.lost = true;
            self.place.remember()?;
            self.lost = false;
        }
        self.pair = pair;
        Ok(())
    }

    /// Tells the user once that hosts cannot come, until they can.
    fn tell(&mut self, moved: io::Result<()>) {
        let failed = moved.err();
        if let (Some(error), false) = (&failed, self.failing) {
            let link = self.link.display();
            self.notices
                .push(format!("{link} cannot lead to a fresh terminal, tried again: {error}"));
        }
        self.failing = failed.is_some();
    }
}

impl Line for PtyLine {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match (&self.pair.master).read(buffer) {
            Ok(read @ 1..) => {
                self.host_is_there();
                Ok(read)
            }
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                self.host_is_there();
                Ok(0)
            }
            // Linux reports a slave that nobody has open as EIO, others as the end of the file.
            Ok(0) => Ok(self.no_host()),
            Err(error) if error.raw_os_error() == Some(Errno::IO.raw_os_error()) => {
                Ok(self.no_host())
            }
            Err(error) => Err(error),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // Bytes sent before a host was noticed are not an answer to it.
        if !self.host_present || !self.pair.has_host() {
            return Ok(bytes.len());
        }
        match (&self.pair.master).write(bytes) {
            Err(error)
                if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) =>
            {
                Ok(0)
            }
            Err(error) if error.raw_os_error() == Some(Errno::IO.raw_os_error()) => Ok(bytes.len()),
            written => written,
        }
    }

    fn host_bits_per_second(&self) -> Option<u32> {
        // Asked of the master, the settings are those that the host made on the slave.
        let settings = termios::tcgetattr(&self.pair.master).ok()?;
        Some(settings.output_speed()).filter(|&bits_per_second| bits_per_second != 0)
    }

    fn take_host_change(&mut self) -> bool {
        mem::take(&mut self.host_changed)
    }

    fn publish(&mut self) -> Result<(), SimError> {
        let doing = || format!("make the link {}", self.link.display());
        match symlink(&self.pair.slave, &self.link) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                return Err(SimError::LinkTaken(self.link.clone()));
            }
            made => made.and_then(|()| self.place.remember()).map_err(SimError::io(doing()))?,
        }
        self.published = true;
        Ok(())
    }

    fn name(&self) -> String {
        self.link.display().to_string()
    }

    fn take_notices(&mut self) -> Vec<String> {
        mem::take(&mut self.notices)
    }

    fn descriptors(&self) -> Vec<BorrowedFd<'_>> {
        // Without a host the master reports that over and over, which would keep us from waiting at
        // all.
        if self.host_present { vec![self.pair.master.as_fd()] } else { Vec::new() }
    }
}

impl PtyLine {
    fn host_is_there(&mut self) {
        if !self.host_present {
            self.host_present = true;
            self.host_changed = true;
        }
    }

    fn no_host(&mut self) -> usize {
        if self.host_present || self.freed.elapsed() > FREE_EVERY {
            self.free();
        }
        0
    }
}

/// Claims the place of the link and removes a link that an earlier simulator has left there.
/// Anything else is refused.
fn claim(link: &Path) -> Result<Claim, SimError> {
    let claim = Claim::on(link, SimError::LinkInUse)?;
    let looking = || SimError::io(format!("look at {}", link.display()));
    match claim.holder().map_err(looking())? {
        Holder::Nobody => Ok(claim),
        Holder::Simulator => claim.remove().map(|()| claim).map_err(looking()),
        Holder::Foreign => Err(SimError::LinkTaken(link.to_owned())),
    }
}

/// Replaces the link by one to `target`, with no moment without a link. The new link first has a
/// name that nobody can foresee, so nobody can be in its way.
fn replace_link(target: &Path, link: &Path) -> io::Result<()> {
    let folder =
        link.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let fresh = tempfile::Builder::new()
        .prefix(".ser-sim-")
        .make_in(folder, |path| symlink(target, path))?;
    Ok(fresh.into_temp_path().persist(link)?)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_link_moves_to_a_fresh_terminal_whatever_stands_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("ser");
        let theirs = folder.path().join(format!("ser.{}", std::process::id()));
        fs::write(&theirs, "theirs").unwrap();
        let mut line = PtyLine::open(Some(&link)).unwrap();
        line.publish().unwrap();
        for _ in 0..3 {
            let before = fs::read_link(&link).unwrap();
            line.move_to_fresh_terminal().unwrap();
            let now = fs::read_link(&link).unwrap();
            assert!(now != before && now == line.pair.slave);
        }
        assert_eq!(fs::read_to_string(&theirs).unwrap(), "theirs");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left behind");
        drop(line);
        assert!(fs::symlink_metadata(&link).is_err(), "still known as ours");
    }

    #[test]
    fn a_link_that_is_away_for_a_while_moves_when_it_is_back() {
        let folder = tempfile::tempdir().unwrap();
        let (link, away) = (folder.path().join("ser"), folder.path().join("away"));
        let mut line = PtyLine::open(Some(&link)).unwrap();
        line.publish().unwrap();
        let before = fs::read_link(&link).unwrap();
        fs::rename(&link, &away).unwrap();
        fs::write(&link, "theirs").unwrap();
        line.move_to_fresh_terminal().unwrap();
        assert_eq!(
            (fs::read_to_string(&link).unwrap(), &line.pair.slave),
            ("theirs".to_owned(), &before)
        );
        fs::remove_file(&link).unwrap();
        line.move_to_fresh_terminal().unwrap();
        assert!(fs::symlink_metadata(&link).is_err(), "what the user has taken away stays away");
        fs::rename(&away, &link).unwrap();
        line.move_to_fresh_terminal().unwrap();
        assert_ne!(fs::read_link(&link).unwrap(), before);
    }

    #[test]
    fn a_link_that_could_not_be_noted_is_made_again() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("ser");
        let mut line = PtyLine::open(Some(&link)).unwrap();
        line.publish().unwrap();
        // As after a record that could not be written.
        fs::remove_file(&link).unwrap();
        line.lost = true;
        fs::write(&link, "theirs").unwrap();
        for _ in 0..2 {
            let failed = line.move_to_fresh_terminal();
            assert!(failed.is_err());
            line.tell(failed);
        }
        assert_eq!(line.take_notices().len(), 1, "told once");
        fs::remove_file(&link).unwrap();
        line.move_to_fresh_terminal().unwrap();
        assert_eq!(fs::read_link(&link).unwrap(), line.pair.slave);
    }
}
