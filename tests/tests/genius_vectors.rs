//! The examples of `vectors/genius.txt`: what they mean, and that we produce the same.

use ser_proto::genius::{
    BusAddress, CommReq, Datagram, DipSwitches, GlobalData, Message, PlcReference, Priority,
    SendDatagram,
};

const PLC: BusAddress = BusAddress::new(31).unwrap();

/// The examples of one kind, each with the line it is on and its other fields.
fn examples(kind: &str) -> Vec<(usize, Vec<&'static str>)> {
    let examples: Vec<_> = include_str!("../vectors/genius.txt")
        .lines()
        .zip(1..)
        .filter(|(line, _)| !line.is_empty() && !line.starts_with('#'))
        .filter_map(|(line, number)| {
            let mut fields = line.split('|').map(str::trim);
            (fields.next() == Some(kind)).then(|| (number, fields.collect()))
        })
        .collect();
    assert!(!examples.is_empty(), "no example of {kind}");
    examples
}

fn bytes(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

fn words(text: &str) -> Vec<u16> {
    text.split_whitespace()
        .map(|word| u16::from_str_radix(word, 16).expect("hexadecimal"))
        .collect()
}

#[test]
fn every_send_block_brings_its_command() {
    for (line, fields) in examples("command") {
        let [block, meaning] = fields[..] else { panic!("line {line}: three fields expected") };
        let block = words(block);
        let Ok(CommReq::Send(send)) = CommReq::parse(&block) else {
            panic!("line {line}: no SEND block")
        };
        let command = send.to_datagram(PLC).command().expect("a command");
        assert_eq!(format!("{command:?}"), meaning, "line {line}");
        let datagram = Datagram {
            priority: send.priority,
            ..Datagram::from_command(PLC, send.target, &command)
        };
        let again = SendDatagram::new(datagram, PlcReference::register(100).expect("a register"));
        assert_eq!(again.to_words(), block[..], "line {line}");
    }
}

#[test]
fn every_dequeue_block_reads_as_it_should() {
    for (line, fields) in examples("fetch") {
        let [block, meaning] = fields[..] else { panic!("line {line}: three fields expected") };
        let block = words(block);
        let fetch = CommReq::parse(&block).expect("a DEQUEUE block");
        assert!(matches!(fetch, CommReq::Dequeue(_)), "line {line}");
        assert_eq!(fetch.to_string(), meaning, "line {line}");
        assert_eq!(fetch.to_words(), block[..], "line {line}");
    }
}

#[test]
fn every_datagram_reads_as_it_should() {
    for (line, fields) in examples("datagram") {
        let [codes, data, meaning] = fields[..] else {
            panic!("line {line}: four fields expected")
        };
        let [function, subfunction] = bytes(codes)[..] else {
            panic!("line {line}: two codes expected")
        };
        let datagram =
            Datagram::new(PLC, PLC.into(), function, subfunction, &bytes(data)).expect("fits");
        let message = Message::parse(&datagram).expect("a datagram of the bus");
        assert_eq!(message.to_string(), meaning, "line {line}");
        assert_eq!(message.to_datagram(PLC, PLC.into(), Priority::Normal), datagram, "line {line}");
    }
}

#[test]
fn all_global_data_show_model_and_inputs() {
    for (line, fields) in examples("global") {
        let [data, meaning] = fields[..] else { panic!("line {line}: three fields expected") };
        let global = GlobalData::parse(&bytes(data)).expect("global data of a recorder");
        assert_eq!(format!("{:?}: {global}", global.model).trim_end(), meaning, "line {line}");
        assert_eq!(global.to_bytes(), bytes(data)[..], "line {line}");
    }
}

#[test]
fn all_switches_say_what_they_should() {
    for (line, fields) in examples("switches") {
        let [open, meaning] = fields[..] else { panic!("line {line}: three fields expected") };
        let bits = open.bytes().rev().fold(0, |bits, digit| bits << 1 | (digit - b'0'));
        let said = match DipSwitches(bits).settings() {
            Ok(settings) => settings.to_string(),
            Err(error) => error.to_string(),
        };
        assert_eq!(said, meaning, "line {line}");
    }
}
