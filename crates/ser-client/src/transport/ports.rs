//! Which serial ports this computer has.

use std::fmt;

use ser_console::Harmless;
use serialport::{SerialPortInfo, SerialPortType};

/// A serial port that can be opened by its path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PortInfo {
    /// Path or name.
    pub path: String,
    /// What it is, in a few words: maker and product of a USB adapter, `PCI`, `Bluetooth`; may be
    /// empty. An adapter may give any text, so characters that a terminal would obey are escaped.
    pub description: String,
}

/// Lists the serial ports, sorted by path.
///
/// On Linux the kernel's list of terminals is read. It lacks pseudo-terminals (a simulated
/// recorder) and links such as `/dev/serial/by-id/…`. Both can still be opened by their path.
#[must_use]
pub fn ports() -> Vec<PortInfo> {
    // serialport panics if the kernel's list is missing, as in some containers.
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    listed(serialport::available_ports().unwrap_or_default())
}

/// The ports that the system lists, in any order.
fn listed(found: Vec<SerialPortInfo>) -> Vec<PortInfo> {
    let named = |port: SerialPortInfo| PortInfo {
        path: port.port_name,
        description: describe(&port.port_type),
    };
    let mut ports: Vec<PortInfo> = found.into_iter().map(named).collect();
    ports.sort_by(|a, b| a.path.cmp(&b.path));
    ports
}

fn describe(port_type: &SerialPortType) -> String {
    match port_type {
        SerialPortType::UsbPort(usb) => {
            let words = [&usb.manufacturer, &usb.product, &usb.serial_number];
            let words: Vec<&str> = words.into_iter().flatten().map(String::as_str).collect();
            let ids = format!("USB {:04x}:{:04x}", usb.vid, usb.pid);
            if words.is_empty() {
                ids
            } else {
                format!("{} ({ids})", Harmless(words.join(" ")).line())
            }
        }
        SerialPortType::PciPort => "PCI".to_owned(),
        SerialPortType::BluetoothPort => "Bluetooth".to_owned(),
        SerialPortType::Unknown => String::new(),
    }
}

impl fmt::Display for PortInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Harmless(&self.path))?;
        if self.description.is_empty() { Ok(()) } else { write!(f, "  {}", self.description) }
    }
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    #[test]
    fn ports_are_listed_by_path() {
        let found =
            [("/dev/ttyUSB0", SerialPortType::Unknown), ("/dev/ttyS1", SerialPortType::PciPort)];
        let found =
            found.map(|(name, port_type)| SerialPortInfo { port_name: name.to_owned(), port_type });
        let texts: Vec<_> = listed(found.to_vec()).iter().map(PortInfo::to_string).collect();
        assert_eq!(texts, ["/dev/ttyS1  PCI", "/dev/ttyUSB0"]);
    }

    #[test]
    fn a_usb_adapter_is_named_by_maker_and_product() {
        let named = SerialPortType::UsbPort(UsbPortInfo {
            vid: 0x0403,
            pid: 0x6001,
            serial_number: None,
            manufacturer: Some("FTDI".to_owned()),
            product: Some("FT232R USB UART".to_owned()),
        });
        assert_eq!(describe(&named), "FTDI FT232R USB UART (USB 0403:6001)");
        assert_eq!(describe(&SerialPortType::Unknown), "");
    }

    #[test]
    fn an_adapter_that_calls_itself_something_else_does_nothing_to_a_terminal() {
        let hostile = SerialPortType::UsbPort(UsbPortInfo {
            vid: 1,
            pid: 2,
            serial_number: Some("\u{9B}2J".to_owned()),
            manufacturer: Some("\u{1B}]0;root\u{7}".to_owned()),
            product: Some("UART\n/dev/ttyS9\u{202E}".to_owned()),
        });
        assert_eq!(
            describe(&hostile),
            r"\u{1b}]0;root\u{7} UART\n/dev/ttyS9\u{202e} \u{9b}2J (USB 0001:0002)"
        );
        let named = PortInfo { path: "/dev/tty\u{1B}c".to_owned(), description: String::new() };
        assert_eq!(named.to_string(), r"/dev/tty\u{1b}c");
    }
}
