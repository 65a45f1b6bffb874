//! The name of a recorder: the same one however its port is spelled, and the names that it may have
//! had before.
//!
//! # Design
//! The state of a recorder is kept under its name, so the name must be the same in every run.
//!
//! - A link is a name that somebody has chosen because it lasts (`/dev/serial/by-id/…`,
//!   `/dev/recorder1`), so it is kept.
//! - The number of a USB adapter does not last. `/dev/ttyUSB0` is replaced by its link in
//!   `/dev/serial/by-id`, if that contains the adapter's serial number. Two adapters without one
//!   would take turns at the same name.
//! - The computer itself is `localhost`, also if it is written `127.0.0.1` or `[::1]`.
//!
//! If there is no state under this name, all other names of the recorder are tried. State under
//! other spellings of the same name, and under names of earlier versions, moves to this name. State
//! under a name in its own right, such as that of the device that a link leads to, stays: the
//! recorder may be called by it again. The number of a pseudo-terminal is not such a name, because
//! the next program that wants one gets it.

use std::fs;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::path::{Path, PathBuf};

use ser_client::{Endpoint, GeniWindow};

/// A recorder's name, and others that it may have had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct UnitName {
    /// The name.
    pub(crate) name: String,
    /// Other spellings, the most descriptive first.
    pub(crate) others: Vec<String>,
    /// Names in their own right.
    pub(crate) aliases: Vec<String>,
}

impl UnitName {
    /// The name of the recorder behind `text`, which has been understood as `endpoint`.
    pub(crate) fn of(text: &str, endpoint: &Endpoint) -> UnitName {
        let (name, others) = names(text, endpoint);
        let mut unit = UnitName { name, others: Vec::new(), aliases: Vec::new() };
        for other in others.into_iter().chain([text.to_owned()]) {
            let is_alias = other.parse().is_ok_and(
                |endpoint| matches!(names(&other, &endpoint), (name, _) if name == other),
            );
            let list = if is_alias { &mut unit.aliases } else { &mut unit.others };
            if other != unit.name && !list.contains(&other) {
                list.push(other);
            }
        }
        unit
    }
}

/// The name of a recorder, and all others.
fn names(text: &str, endpoint: &Endpoint) -> (String, Vec<String>) {
    match endpoint {
        Endpoint::Tcp { address } => tcp_names(address),
        Endpoint::Geni { window, node } => window_names(window, *node),
        // On other systems the names of ports are not paths.
        Endpoint::Serial { path } if cfg!(unix) => {
            Devices::of_this_computer().names(Path::new(path))
        }
        _ => (text.to_owned(), Vec::new()),
    }
}

fn tcp_names(address: &str) -> (String, Vec<String>) {
    let name = |host: &str, port: &str| format!("tcp://{host}:{port}");
    let Some((host, port)) = address.rsplit_once(':') else {
        return (address.to_owned(), Vec::new());
    };
    let port = port.parse::<u16>().map_or(port.to_owned(), |port| port.to_string());
    let host = host.strip_suffix('.').unwrap_or(host).to_lowercase();
    let bare = host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(&host);
    let ip = bare.parse().map(|ip: IpAddr| ip.to_canonical()).ok();
    let here = ip.is_some_and(|ip| ip == Ipv4Addr::LOCALHOST || ip == Ipv6Addr::LOCALHOST);
    match ip {
        _ if here || host == "localhost" => (
            name("localhost", &port),
            ["127.0.0.1", "[::1]"].map(|host| name(host, &port)).to_vec(),
        ),
        Some(IpAddr::V4(ip)) => (name(&ip.to_string(), &port), Vec::new()),
        Some(IpAddr::V6(ip)) => (name(&format!("[{ip}]"), &port), Vec::new()),
        None => (name(&host, &port), Vec::new()),
    }
}

fn window_names(window: &GeniWindow, node: Option<u8>) -> (String, Vec<String>) {
    let name = |file: Option<PathBuf>, offset| {
        let file =
            file.and_then(|file| file.to_str().map(str::to_owned)).unwrap_or(window.file.clone());
        Endpoint::Geni { window: GeniWindow { file, offset }, node }.to_string()
    };
    let absolute = std::path::absolute(&window.file).ok();
    let canonical = fs::canonicalize(&window.file).ok().or(absolute.clone());
    // Without an offset the window is at the beginning.
    let offset = window.offset.filter(|&offset| offset != 0);
    (name(canonical, offset), vec![name(absolute, window.offset)])
}

/// The system's devices, and what it knows of them.
struct Devices {
    /// Links whose names come from what the adapter says of itself.
    by_id: PathBuf,
    /// A folder for each terminal, with a link to its device.
    terminals: PathBuf,
    /// The folder of names that are numbers and are reused at once.
    pseudo_terminals: PathBuf,
}

/// Nobody chooses names by a chain of more links.
const MAX_LINKS: usize = 16;

/// How far above a terminal its USB adapter is: port and interface are between them.
const MAX_LEVELS: usize = 4;

impl Devices {
    fn of_this_computer() -> Devices {
        Devices {
            by_id: "/dev/serial/by-id".into(),
            terminals: "/sys/class/tty".into(),
            pseudo_terminals: "/dev/pts".into(),
        }
    }

    fn names(&self, path: &Path) -> (String, Vec<String>) {
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let mut others = Vec::new();
        if let Ok(absolute) = std::path::absolute(path) {
            others.push(text(&absolute));
        }
        let Some(place) = place(path) else {
            // The port is not there, and opening it will say so.
            let name = others.pop().unwrap_or(text(path));
            return (name, others);
        };
        let device = fs::canonicalize(&place).unwrap_or(place.clone());
        let by_id = self.links_by_id(&device);
        let lasting = by_id.first().filter(|_| place == device && self.has_serial_number(&device));
        let name = text(lasting.unwrap_or(&place));
        others.extend(links_from(&place).iter().chain(&by_id).map(|path| text(path)));
        if !device.starts_with(&self.pseudo_terminals) {
            others.push(text(&device));
        }
        (name, others)
    }

    fn links_by_id(&self, device: &Path) -> Vec<PathBuf> {
        let links =
            fs::read_dir(&self.by_id).into_iter().flatten().flatten().map(|link| link.path());
        let mut links: Vec<PathBuf> = links
            .filter(|link| fs::canonicalize(link).is_ok_and(|target| target == device))
            .collect();
        links.sort();
        links
    }

    /// Whether the USB adapter of a terminal has a serial number that distinguishes it from others
    /// of its kind.
    fn has_serial_number(&self, device: &Path) -> bool {
        let Some(name) = device.file_name() else { return false };
        let Ok(device) = fs::canonicalize(self.terminals.join(name).join("device")) else {
            return false;
        };
        // The search must stop at the adapter, because the hubs above have serial numbers, too.
        let adapter =
            device.ancestors().take(MAX_LEVELS).find(|folder| folder.join("idVendor").exists());
        adapter.is_some_and(|adapter| adapter.join("serial").exists())
    }
}

/// The path without `.`, `..` and links to folders; its last part may be a link.
fn place(path: &Path) -> Option<PathBuf> {
    let last = path.file_name()?;
    let folder =
        path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Some(fs::canonicalize(folder).ok()?.join(last))
}

/// The links that a link leads through, without its final target.
fn links_from(place: &Path) -> Vec<PathBuf> {
    let next = |link: &PathBuf| {
        let target = fs::read_link(link).ok()?;
        self::place(&link.parent()?.join(target)).filter(|place| place.is_symlink())
    };
    std::iter::successors(Some(place.to_owned()), next).skip(1).take(MAX_LINKS).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> UnitName {
        UnitName::of(text, &text.parse().expect("a port"))
    }

    #[test]
    fn this_computer_has_one_name() {
        let spellings = [
            "localhost",
            "127.0.0.1",
            "[::1]",
            "LocalHost",
            "localhost.",
            "[0:0::1]",
            "[::ffff:127.0.0.1]",
        ];
        for host in spellings {
            let unit = of(&format!("tcp://{host}:4000"));
            assert_eq!(unit.name, "tcp://localhost:4000", "{host}");
            assert!(unit.others.contains(&"tcp://127.0.0.1:4000".to_owned()), "{unit:?}");
            assert!(unit.others.contains(&"tcp://[::1]:4000".to_owned()), "{unit:?}");
        }
        assert_ne!(of("tcp://localhost:4001").name, of("tcp://localhost:4000").name);
        assert_ne!(of("tcp://127.0.0.2:4000").name, of("tcp://127.0.0.1:4000").name);
    }

    #[test]
    fn an_address_is_the_same_however_it_is_written() {
        for (text, name, others) in [
            ("tcp://10.0.0.7:4000", "tcp://10.0.0.7:4000", vec![]),
            (
                "tcp://10.0.0.7:04000",
                "tcp://10.0.0.7:4000",
                vec!["tcp://10.0.0.7:04000".to_owned()],
            ),
            (
                "tcp://Server.Local:1",
                "tcp://server.local:1",
                vec!["tcp://Server.Local:1".to_owned()],
            ),
            ("tcp://[FE80::7]:1", "tcp://[fe80::7]:1", vec!["tcp://[FE80::7]:1".to_owned()]),
        ] {
            assert_eq!(of(text), UnitName { name: name.to_owned(), others, aliases: Vec::new() });
        }
    }

    #[cfg(unix)]
    mod on_unix {
        use std::os::unix::fs::symlink;

        use tempfile::TempDir;

        use super::*;

        /// A computer with adapters. A serial number only makes a difference in `/sys`.
        struct Computer {
            root: TempDir,
        }

        impl Computer {
            fn new() -> Computer {
                let root = tempfile::tempdir().unwrap();
                for folder in ["dev/serial/by-id", "dev/pts", "sys/class/tty"] {
                    fs::create_dir_all(root.path().join(folder)).unwrap();
                }
                Computer { root }
            }

            fn path(&self, path: &str) -> PathBuf {
                fs::canonicalize(self.root.path()).unwrap().join(path)
            }

            fn text(&self, path: &str) -> String {
                self.path(path).to_str().unwrap().to_owned()
            }

            fn plug_in(&self, device: &str, id: &str, serial: Option<&str>) {
                let usb = self.path(&format!("sys/devices/usb1/1-{id}"));
                let port = usb.join("1:1.0").join(device);
                fs::create_dir_all(&port).unwrap();
                for file in ["../idVendor", "../serial", "idVendor"] {
                    fs::write(usb.join(file), "x").unwrap();
                }
                if let Some(serial) = serial {
                    fs::write(usb.join("serial"), serial).unwrap();
                }
                fs::create_dir_all(self.path("sys/class/tty").join(device)).unwrap();
                symlink(port, self.path("sys/class/tty").join(device).join("device")).unwrap();
                fs::write(self.path("dev").join(device), "").unwrap();
                let link = self.path("dev/serial/by-id").join(id);
                let _ = fs::remove_file(&link);
                symlink(format!("../../{device}"), link).unwrap();
            }

            fn names(&self, path: &str) -> (String, Vec<String>) {
                let devices = Devices {
                    by_id: self.path("dev/serial/by-id"),
                    terminals: self.path("sys/class/tty"),
                    pseudo_terminals: self.path("dev/pts"),
                };
                devices.names(&self.path(path))
            }
        }

        #[test]
        fn an_adapter_is_called_by_its_id_whatever_its_number() {
            let computer = Computer::new();
            computer.plug_in("ttyUSB0", "FTDI_A1", Some("A1"));
            let by_id = computer.text("dev/serial/by-id/FTDI_A1");
            let device = computer.text("dev/ttyUSB0");
            for path in
                ["dev/ttyUSB0", "dev/serial/by-id/FTDI_A1", "dev/serial/by-id/../../ttyUSB0"]
            {
                let (name, others) = computer.names(path);
                assert_eq!(name, by_id, "{path}");
                assert!(others.contains(&device), "{others:?}");
            }
        }

        #[test]
        fn adapters_that_cannot_be_told_apart_keep_their_numbers() {
            let computer = Computer::new();
            computer.plug_in("ttyUSB0", "CH340", None);
            let (device, by_id) =
                (computer.text("dev/ttyUSB0"), computer.text("dev/serial/by-id/CH340"));
            let (name, others) = computer.names("dev/ttyUSB0");
            assert_eq!(name, device);
            assert!(others.contains(&by_id));
            // The user asks for this name explicitly.
            assert_eq!(computer.names("dev/serial/by-id/CH340").0, by_id);
        }

        #[test]
        fn a_link_that_somebody_has_made_keeps_its_name_and_shares_what_is_known() {
            let computer = Computer::new();
            computer.plug_in("ttyUSB0", "FTDI_A1", Some("A1"));
            symlink("ttyUSB0", computer.path("dev/recorder1")).unwrap();
            symlink("dev/recorder1", computer.path("mine")).unwrap();
            let (name, others) = computer.names("mine");
            assert_eq!(name, computer.text("mine"));
            for other in ["dev/recorder1", "dev/serial/by-id/FTDI_A1", "dev/ttyUSB0"] {
                assert!(others.contains(&computer.text(other)), "{others:?}");
            }
        }

        #[test]
        fn a_simulated_unit_is_its_link_and_not_the_number_of_its_terminal() {
            let computer = Computer::new();
            fs::write(computer.path("dev/pts/7"), "").unwrap();
            fs::create_dir(computer.path("sub")).unwrap();
            symlink(computer.path("dev/pts/7"), computer.path("ser")).unwrap();
            symlink(computer.path("sub"), computer.path("folder")).unwrap();
            let ser = computer.text("ser");
            for path in ["ser", "sub/../ser", "./ser", "folder/../ser"] {
                let (name, others) = computer.names(path);
                assert_eq!(name, ser, "{path}");
                assert!(!others.contains(&computer.text("dev/pts/7")), "{others:?}");
            }
            // The name that an earlier version used.
            let (_, others) = computer.names("sub/../ser");
            assert!(
                others.contains(&format!("{}/sub/../ser", computer.text("").trim_end_matches('/')))
            );
        }

        #[test]
        fn links_in_a_circle_end() {
            let computer = Computer::new();
            symlink("b", computer.path("a")).unwrap();
            symlink("a", computer.path("b")).unwrap();
            assert_eq!(computer.names("a").0, computer.text("a"));
            assert_eq!(computer.names("none/of/this").0, computer.text("none/of/this"));
        }

        #[test]
        fn a_window_is_the_same_by_a_link_by_dots_and_with_no_offset() {
            let folder = tempfile::tempdir().unwrap();
            let root = fs::canonicalize(folder.path()).unwrap();
            let root = root.to_str().unwrap();
            fs::write(folder.path().join("host"), "").unwrap();
            symlink("host", folder.path().join("link")).unwrap();
            for (spelled, name) in [
                ("host?node=5", "host?node=5"),
                ("link?node=5", "host?node=5"),
                ("./host?node=5&offset=0", "host?node=5"),
                ("host?node=6", "host?node=6"),
                ("host?node=5&offset=0x10", "host?node=5&offset=0x10"),
                ("none?node=5", "none?node=5"),
            ] {
                let unit = of(&format!("geni:{root}/{spelled}"));
                assert_eq!(unit.name, format!("geni:{root}/{name}"));
            }
        }
    }
}
