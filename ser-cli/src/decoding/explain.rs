//! A message as text.

use clap::ValueEnum;
use ser_proto::{
    AutoReport, Command, Configuration, Configure, Entry, Mode, Model, ParseError, ReadReply,
    Reply, TimeStamp,
};

use super::Kind;
use super::extension::{
    clock_text, counter_lines, counters_text, filter_lines, filters_text, identity_text,
    question_text, setting_text,
};
use crate::values::on_off;

/// Who sent a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// Commands.
    Host,
    /// Replies and auto reports.
    #[value(alias = "unit")]
    Recorder,
}

/// The meaning of a body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Explanation {
    pub(crate) kind: Kind,
    pub(crate) text: String,
    /// The entries of a read reply, the filters or the counters.
    pub(crate) details: Vec<String>,
}

impl Explanation {
    /// Whether the body is not a message.
    pub(crate) fn is_damage(&self) -> bool {
        self.kind == Kind::Damage
    }
}

/// Explains a body. If `from` is not known and both sides could have sent it, gives both readings.
pub(crate) fn explain(body: &[u8], from: Option<Side>) -> Explanation {
    let command = (from != Some(Side::Recorder)).then(|| Command::parse(body));
    let reply = (from != Some(Side::Host)).then(|| Reply::parse(body));
    let plain = |kind, text| Explanation { kind, text, details: Vec::new() };
    match (command, reply) {
        (Some(Ok(command)), Some(Ok(reply))) => plain(
            Kind::Either,
            format!("host: {} | recorder: {}", command_text(&command), reply_text(&reply)),
        ),
        (Some(Ok(command)), _) => plain(Kind::Host, command_text(&command)),
        (_, Some(Ok(reply))) => Explanation {
            kind: Kind::Recorder,
            text: reply_text(&reply),
            details: detail_lines(&reply),
        },
        (command, reply) => plain(
            Kind::Damage,
            no_message(body, command.and_then(Result::err), reply.and_then(Result::err)),
        ),
    }
}

fn no_message(body: &[u8], as_command: Option<ParseError>, as_reply: Option<ParseError>) -> String {
    let why = match (as_command, as_reply) {
        (Some(command), Some(reply)) if command != reply => {
            format!("as a command: {command}; as a reply: {reply}")
        }
        (Some(why), _) | (None, Some(why)) => why.to_string(),
        (None, None) => "empty".to_string(),
    };
    format!("not a message: {why} ({})", hex_text(body))
}

/// Bytes as `52 01 F4 05`.
pub(crate) fn hex_text(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

fn command_text(command: &Command) -> String {
    match *command {
        Command::QueryConfiguration => "query the configuration".to_string(),
        Command::Configure(configure) => format!("configure: {}", configure_text(&configure)),
        Command::Erase => "erase the event buffer".to_string(),
        Command::LastBroadcast => "query the last broadcast".to_string(),
        Command::QueryMode => "query mode and version".to_string(),
        Command::SetMode { recording: true } => "start recording".to_string(),
        Command::SetMode { recording: false } => "stop recording".to_string(),
        Command::Print { start, count } => format!("print {} from entry {start}", entries(count)),
        Command::Read { count: 0, start } => {
            format!("read no entries from entry {start}, the header only")
        }
        Command::Read { start, count } => {
            format!("read {} from entry {start}", entries(count.into()))
        }
        Command::SetClock(time) => format!("set the clock to {time}"),
        Command::Identify => "ask what the recorder is and can do".to_string(),
        Command::Time { token } => question_text(token),
        Command::QueryFilters { first } => format!("query the filters from input {first} on"),
        Command::SetFilter { input, filter } => {
            setting_text(input.map(std::num::NonZeroU8::get), &filter)
        }
        Command::Diagnostics { first } => format!("query the counters from id {} on", first.id()),
    }
}

fn reply_text(reply: &Reply) -> String {
    match reply {
        Reply::Configuration(configuration) => {
            format!("configuration: {}", configuration_text(configuration))
        }
        Reply::Erased => "event buffer erased".to_string(),
        Reply::LastBroadcast(None) => "no broadcast yet".to_string(),
        Reply::LastBroadcast(Some(last)) => format!("last broadcast: {last}"),
        Reply::Mode(mode) => mode_text(*mode),
        Reply::PrintAccepted => "print accepted".to_string(),
        Reply::Read(reply) => read_reply_text(reply),
        Reply::ClockSet => "clock set".to_string(),
        Reply::Identity(identity) => identity_text(identity),
        Reply::Time(reading) => clock_text(reading),
        Reply::Filters(filters) => filters_text(filters),
        Reply::Diagnostics(counters) => counters_text(counters),
    }
}

fn mode_text(mode: Mode) -> String {
    mode.to_string()
}

fn configure_text(configure: &Configure) -> String {
    let size = configure.size.map_or("size kept".to_string(), |size| format!("size {size}"));
    let baud = configure
        .baud
        .map_or("baud kept".to_string(), |baud| format!("{} baud", baud.bits_per_second()));
    format!(
        "{size}, {baud}, {}, auto print {}",
        auto_report_text(configure.auto_report, configure.report_address),
        on_off(configure.auto_print)
    )
}

fn configuration_text(configuration: &Configuration) -> String {
    configure_text(&Configure::from(*configuration))
}

fn auto_report_text(auto_report: AutoReport, address: u8) -> String {
    match auto_report {
        AutoReport::Off => format!("auto report off (address {address})"),
        AutoReport::Genius => format!("auto report to Genius address {address}"),
        AutoReport::Rs232 => format!("auto report on RS-232 (address {address})"),
    }
}

fn read_reply_text(reply: &ReadReply) -> String {
    let ReadReply { start, total, next_slot, model, entries: found } = reply;
    let count = u16::try_from(found.len()).unwrap_or(u16::MAX);
    let inputs = model.map_or(String::new(), |model: Model| format!("; {} inputs", model.inputs()));
    format!(
        "read reply: {} from entry {start}; total {total}, next slot {next_slot}{inputs}",
        entries(count)
    )
}

fn detail_lines(reply: &Reply) -> Vec<String> {
    match reply {
        Reply::Read(reply) => entry_lines(reply),
        Reply::Filters(filters) => filter_lines(filters),
        Reply::Diagnostics(counters) => counter_lines(counters),
        _ => Vec::new(),
    }
}

fn entry_lines(reply: &ReadReply) -> Vec<String> {
    (u32::from(reply.start)..)
        .zip(&reply.entries)
        .map(|(number, entry)| {
            format!("{number:>5}  {}{}  {}", entry.time, remark(&entry.time), changes(entry))
        })
        .collect()
}

fn remark(time: &TimeStamp) -> String {
    time.check().err().map_or(String::new(), |invalid| format!(" ({invalid})"))
}

fn changes(entry: &Entry) -> String {
    if entry.changed.is_empty() {
        return "no input".to_string();
    }
    let change =
        |input| format!("{input} {}", if entry.state.contains(input) { "ON" } else { "OFF" });
    entry.changed.numbers().map(change).collect::<Vec<_>>().join("  ")
}

fn entries(count: u16) -> String {
    match count {
        0 => "no entries".to_string(),
        1 => "1 entry".to_string(),
        count => format!("{count} entries"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(body: &[u8], from: Option<Side>) -> String {
        let explanation = explain(body, from);
        format!("{:?}: {}", explanation.kind, explanation.text)
    }

    #[test]
    fn the_manuals_examples_read_like_this() {
        for (body, meaning) in [
            (
                &[0x43, 4, 0, 6, 2, 1, 0][..],
                "Host: configure: size 1024, 9600 baud, auto report to Genius address 1, auto \
                 print off",
            ),
            (&[0x45], "Host: erase the event buffer"),
            (&[0x4C], "Host: query the last broadcast"),
            (&[0x4D], "Host: query mode and version"),
            (&[0x43], "Host: query the configuration"),
            (&[0x4D, 1, 0x7D], "Host: start recording"),
            (&[0x50, 0x32, 0x64], "Host: print 100 entries from entry 50"),
            (&[0x52, 1, 0xF4, 5], "Host: read 5 entries from entry 500"),
            (&[0x52, 0, 1, 0], "Host: read no entries from entry 1, the header only"),
            (
                &[0x53, 96, 11, 21, 22, 30, 50, 0, 250],
                "Host: set the clock to 1996-11-21T22:30:50.250",
            ),
        ] {
            assert_eq!(text(body, Some(Side::Host)), meaning);
        }
        for (body, meaning) in [
            (
                &[0x43, 4, 0, 6, 3, 1, 1][..],
                "Recorder: configuration: size 1024, 9600 baud, auto report on RS-232 (address \
                 1), auto print on",
            ),
            (&[0x45], "Recorder: event buffer erased"),
            (&[0x4C, 0x45, 14, 30, 50, 0, 250], "Recorder: last broadcast: erase at 14:30:50.250"),
            (&[0x4D, 1, 0x7D], "Recorder: recording, version 1.25"),
            (&[0x50], "Recorder: print accepted"),
            (&[0x53], "Recorder: clock set"),
        ] {
            assert_eq!(text(body, Some(Side::Recorder)), meaning);
        }
    }

    /// The bytes of hexadecimal digits.
    fn bytes(digits: &str) -> Vec<u8> {
        let digits = digits.replace(' ', "");
        let byte = |at| u8::from_str_radix(&digits[at..at + 2], 16).unwrap();
        (0..digits.len()).step_by(2).map(byte).collect()
    }

    #[test]
    fn questions_of_the_extension_read_like_this() {
        for (body, meaning) in [
            ("49", "Host: ask what the recorder is and can do"),
            ("54 BEEF", "Host: query the clock, token BEEFh"),
            ("54", "Host: query the clock, token 0000h"),
            ("46", "Host: query the filters from input 1 on"),
            ("46 11", "Host: query the filters from input 17 on"),
            (
                "46 03 05 0A 03E8 07D0",
                "Host: set the filter of input 3: debounce 5 ms, chatter from 10 changes in 1000 \
                 ms until quiet for 2000 ms",
            ),
            (
                "46 00 00 00 0000 0000",
                "Host: set the filters of all inputs: debounce off, chatter filter off",
            ),
            ("44 20", "Host: query the counters from id 32 on"),
        ] {
            assert_eq!(text(&bytes(body), Some(Side::Host)), meaning);
        }
        let refused = text(&bytes("46 03 05 04 03E8 07D0"), Some(Side::Host));
        assert!(refused.contains("message F cannot have 4 (04h) at byte 3"), "{refused}");
    }

    #[test]
    fn replies_of_the_extension_read_like_this() {
        let identity =
            "49 01 20 010203 0000010F 001F002B3347511137353830 0000002A 00000103 0800 00";
        let nameless =
            "49 01 10 000100 00000000 000000000000000000000000 00000001 00000001 0100 02";
        for (body, meaning) in [
            (
                identity,
                "Recorder: identity: 32 inputs, firmware 1.2.3, id 001f002b3347511137353830; level \
                 1, with time, filters, diagnostics, lasting counts, bits 00000100h; power-up 42, \
                 life 259; a log of up to 2048 entries; no guard",
            ),
            (
                nameless,
                "Recorder: identity: 16 inputs, firmware 0.1.0, no id; level 1, with nothing; \
                 power-up 1, life 1; a log of up to 256 entries; guard in state 2, which is not \
                 known here",
            ),
            (
                "54 BEEF 0003 5D01 3B37 E00A 02 00000E10 000007D0 FFFFCF2C 00000000D693A400 \
                 00000103 0000000000010005 0007 00035D013B37E000",
                "Recorder: clock: 2000-01-01T00:00:00.000010, set by a host over RS-232 3600 s \
                 ago, doubt 2000 us, drift -12500 ppb; token BEEFh, 3600000000 us after power-up; \
                 life 259, next sequence 65541; last mark 0007h at 2000-01-01T00:00:00.000000",
            ),
            (
                "54 0000 7FFFFFFFFFFFFFFF 00 00000001 FFFFFFFF 80000000 00000000000F4240 00000001 \
                 0000000000000001 0000 8000000000000000",
                "Recorder: clock: 9223372036854775807 us since 1970, never set, doubt not known, \
                 drift not known; token 0000h, 1000000 us after power-up; life 1, next sequence 1; \
                 no mark yet",
            ),
        ] {
            assert_eq!(text(&bytes(body), Some(Side::Recorder)), meaning);
        }
        let cut_off = text(&bytes(&identity[..33]), None);
        assert!(
            cut_off.contains("ends after 14 bytes, before the field at byte 10 is complete"),
            "{cut_off}"
        );
    }

    #[test]
    fn filters_and_counters_are_listed() {
        let lists = [
            (
                "46 10 02 05 0A 03E8 07D0 00 00 0000 0000",
                "filters of 2 inputs from input 16 on",
                vec![
                    "   16  debounce 5 ms, chatter from 10 changes in 1000 ms until quiet for 2000 ms",
                    "   17  debounce off, chatter filter off",
                ],
            ),
            ("46 11 00", "filters: none from input 17 on", vec![]),
            (
                "44 0B 20 02 00000003 00000000",
                "2 counters from id 11 on; more from id 32 on",
                vec!["   11  edges_lost  3", "   12  samples_missed  0"],
            ),
            (
                "44 C8 00 01 FFFFFFFF",
                "1 counter, id 200; no more",
                vec!["  200  not known here  4294967295"],
            ),
        ];
        for (body, meaning, details) in lists {
            let explanation = explain(&bytes(body), Some(Side::Recorder));
            assert_eq!(
                (&explanation.text[..], explanation.details),
                (meaning, details.iter().map(|line| (*line).to_owned()).collect())
            );
        }
    }

    #[test]
    fn what_both_could_have_sent_gets_both_readings() {
        assert_eq!(
            text(&[0x45], None),
            "Either: host: erase the event buffer | recorder: event buffer erased"
        );
        assert_eq!(text(&[0x53], None), "Recorder: clock set");
    }

    #[test]
    fn entries_are_listed_with_their_numbers() {
        let mut body = vec![0x52, 0x07, 0xFF, 2, 0x10, 0, 0, 1];
        body.extend([0, 5, 0, 1, 26, 11, 22, 10, 0, 0, 0, 250]);
        body.extend([0, 0, 0, 1, 26, 13, 22, 10, 0, 0, 0, 250]);
        let explanation = explain(&body, None);
        assert_eq!(
            explanation.text,
            "read reply: 2 entries from entry 2047; total 4096, next slot 1; 16 inputs"
        );
        assert_eq!(
            explanation.details,
            [
                " 2047  2026-11-22T10:00:00.250  1 ON  3 OFF",
                " 2048  2026-13-22T10:00:00.250 (there is no month 13 in such a date)  no input"
            ]
        );
    }

    #[test]
    fn what_is_no_message_is_shown_with_the_reason() {
        assert_eq!(
            text(&[0x58, 1], None),
            "Damage: not a message: unknown command byte 58h (58 01)"
        );
        let why = Command::parse(&[0x4D, 2, 0]).unwrap_err();
        assert_eq!(
            text(&[0x4D, 2, 0], Some(Side::Host)),
            format!("Damage: not a message: {why} (4D 02 00)")
        );
        let no_command = Command::parse(&[0x52, 0, 1, 0, 0, 0, 0, 0, 9]).unwrap_err();
        let both = text(&[0x52, 0, 1, 0, 0, 0, 0, 0, 9], None);
        assert!(both.contains(&format!("as a command: {no_command}; as a reply: ")), "{both}");
    }
}
