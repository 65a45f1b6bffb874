//! Datagrams of the Genius bus, global data and DIP switches.

use ser_proto::genius::{
    Address, BusAddress, Datagram, DipSwitches, FUNCTION_GENIUS, FUNCTION_HORNER, GlobalData,
    MAX_DATA, Message, MessageError, Priority, SUBFUNCTION_SER, SerDatagramError, Subfunction,
};
use ser_proto::{Command, Reply};

use super::script::Script;

/// `data` is source, destination, function, subfunction and priority, followed by what the datagram
/// carries.
///
/// - The bus's own datagrams are understood if, and only if, they are as `docs/genius.md` says, and
///   are sent as the same bytes. A refusal gives a reason that applies.
/// - A recorder's messages are those of `commands` and `replies`, and only under their own codes.
/// - Global data are sent as the bytes that came in. DIP switches are understood or refused.
///
/// # Panics
/// When one of these does not hold.
pub fn datagrams(data: &[u8]) {
    let mut script = Script::new(data);
    dip_switches(script.clone().byte());
    let source = BusAddress::new(script.byte() % 32).expect("32 devices");
    let destination = Address::from_number(script.byte()).unwrap_or(Address::Broadcast);
    let (function, subfunction) = (script.byte(), script.byte());
    let priority = Priority::from_code(script.byte() % 2).expect("two priorities");
    let carried = script.rest();
    global_data(carried);
    match Datagram::new(source, destination, function, subfunction, carried) {
        Ok(datagram) => {
            let datagram = Datagram { priority, ..datagram };
            assert!(!datagram.to_string().is_empty());
            bus_message(&datagram);
            recorder_message(&datagram);
        }
        Err(too_much) => {
            assert_eq!(too_much.length, carried.len());
            assert!(carried.len() > MAX_DATA);
        }
    }
}

fn bus_message(datagram: &Datagram) {
    let parsed = Message::parse(datagram);
    assert_eq!(parsed.is_ok(), is_bus_message(datagram), "{parsed:?}");
    match parsed {
        Ok(message) => {
            let subfunction = Subfunction::from_code(datagram.subfunction);
            assert_eq!((datagram.function, message.subfunction()), (FUNCTION_GENIUS, subfunction));
            assert_eq!(subfunction.code(), datagram.subfunction);
            assert!(message.to_string().starts_with(&subfunction.to_string()));
            let sent =
                message.to_datagram(datagram.source, datagram.destination, datagram.priority);
            let mut expected = datagram.clone();
            if let (Subfunction::ReadIdReply, Some(rate)) = (subfunction, expected.data.last_mut())
            {
                // Half of this byte has no meaning.
                *rate &= 0xF0;
            }
            assert_eq!(sent, expected);
            assert_eq!(Message::parse(&sent), Ok(message));
        }
        Err(MessageError::WrongFunction { function }) => {
            assert_eq!(function, datagram.function);
            assert_ne!(function, FUNCTION_GENIUS);
        }
        Err(MessageError::WrongLength { subfunction, length }) => {
            assert_eq!((subfunction.code(), length), (datagram.subfunction, datagram.data.len()));
        }
        Err(MessageError::BadValue { subfunction, offset, value }) => {
            assert_eq!(
                (subfunction.code(), Some(&value)),
                (datagram.subfunction, datagram.data.get(offset))
            );
        }
    }
}

/// Whether a datagram has one of the known layouts, or a code that we do not know.
fn is_bus_message(datagram: &Datagram) -> bool {
    let data = &datagram.data[..];
    datagram.function == 0x20
        && match datagram.subfunction {
            0x00 => data.is_empty(),
            0x01 => data.len() == 12 && data[11] < 0x40,
            0x0B => data.len() == 8 && data[0] == 4,
            0x1E => data.len() == 4 && data[0] <= 128,
            0x1F | 0x20 => {
                (4..=132).contains(&data.len()) && usize::from(data[0]) == data.len() - 4
            }
            0x40 => matches!(data, [0..=3]),
            0x41 => matches!(data, [0..=3, ..]) && data.len() <= 129,
            _ => true,
        }
}

fn recorder_message(datagram: &Datagram) {
    let (command, reply) = (datagram.command(), datagram.reply());
    match (datagram.function, datagram.subfunction) {
        (FUNCTION_HORNER, SUBFUNCTION_SER) => {
            assert_eq!(command, Command::parse(&datagram.data).map_err(SerDatagramError::Message));
            assert_eq!(reply, Reply::parse(&datagram.data).map_err(SerDatagramError::Message));
        }
        (FUNCTION_HORNER, subfunction) => {
            let expected = SerDatagramError::WrongSubfunction { subfunction };
            assert_eq!((command, reply), (Err(expected), Err(expected)));
            return;
        }
        (function, _) => {
            let expected = SerDatagramError::WrongFunction { function };
            assert_eq!((command, reply), (Err(expected), Err(expected)));
            return;
        }
    }
    if let Ok(command) = command {
        let sent = Datagram::from_command(datagram.source, datagram.destination, &command);
        assert_eq!(sent.command(), Ok(command));
    }
    if let (Ok(reply), Address::Device(to)) = (reply, datagram.destination) {
        // What came in a datagram fits a datagram.
        let sent = Datagram::from_reply(datagram.source, to, &reply).expect("a reply that fits");
        assert_eq!(sent.reply(), Ok(reply));
    }
}

fn global_data(bytes: &[u8]) {
    match GlobalData::parse(bytes) {
        Ok(global) => {
            assert_eq!(bytes.len(), GlobalData::len(global.model));
            assert_eq!(global.state.0 & !global.model.mask(), 0);
            assert_eq!(*global.to_bytes(), *bytes);
        }
        Err(error) => {
            assert_eq!(error.length, bytes.len());
            assert!(![2, 4].contains(&bytes.len()));
        }
    }
}

fn dip_switches(byte: u8) {
    let switches = DipSwitches(byte);
    match switches.settings() {
        Ok(settings) => assert_eq!(settings.switches(), switches),
        Err(_) => assert!(!switches.is_open(8)),
    }
}
