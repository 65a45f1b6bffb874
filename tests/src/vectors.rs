//! The protocol vectors: examples of frames with what they mean, from `vectors/rs232.txt` and, for
//! our extension, from `vectors/extension.txt`.

use ser_proto::{Command, Decoded, ESC, FrameDecoder, Reply};

/// Who sends a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// A host: the frame holds a command.
    Host,
    /// The recorder: the frame holds a reply.
    Unit,
}

/// One example.
#[derive(Clone, Debug)]
pub struct Vector {
    /// The file.
    pub file: &'static str,
    /// The line of the file, for messages.
    pub line: usize,
    /// Who sends it.
    pub sender: Sender,
    /// Whether it is refused, in whole or in part.
    pub refused: bool,
    /// Whether our encoder produces exactly these bytes.
    pub canonical: bool,
    /// The frame as it travels.
    pub wire: Vec<u8>,
    /// What it decodes to, in the words of `Debug`.
    pub meaning: String,
}

/// All examples of the files.
///
/// # Panics
/// When a file differs from the format that its head describes.
#[must_use]
pub fn all() -> Vec<Vector> {
    let files = [
        ("rs232.txt", include_str!("../vectors/rs232.txt")),
        ("extension.txt", include_str!("../vectors/extension.txt")),
    ];
    files
        .into_iter()
        .flat_map(|(file, text)| {
            (1..).zip(text.lines()).map(move |(line, text)| (file, line, text))
        })
        .filter(|(_, _, text)| !text.is_empty() && !text.starts_with('#'))
        .map(|(file, line, text)| vector(file, line, text))
        .collect()
}

fn vector(file: &'static str, line: usize, text: &str) -> Vector {
    let fields: Vec<_> = text.split('|').map(str::trim).collect();
    let [verdict, sender, bytes, meaning] = fields[..] else {
        panic!("{file}, line {line}: four fields expected")
    };
    let sender = match sender {
        "host" => Sender::Host,
        "unit" => Sender::Unit,
        other => panic!("{file}, line {line}: sender {other}"),
    };
    let mut wire = Vec::new();
    for (position, byte) in bytes.split(' ').enumerate() {
        match position {
            0 => wire.push(u8::from_str_radix(byte, 16).expect("hexadecimal")),
            _ => wire.extend(byte.bytes()),
        }
    }
    assert_eq!(wire.first(), Some(&ESC), "{file}, line {line}: a frame starts with ESC");
    let (refused, canonical) = match verdict {
        "holds" | "corrected" | "ours" => (false, true),
        "accepted" => (false, false),
        "misprint" | "refused" => (true, false),
        other => panic!("{file}, line {line}: verdict {other}"),
    };
    Vector { file, line, sender, refused, canonical, wire, meaning: meaning.to_owned() }
}

/// What a decoder makes of a stream, in the words of `Debug`: messages, refusals and stretches of
/// text.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Messages and refusals, in order.
    pub messages: Vec<String>,
    /// Everything outside frames.
    pub text: Vec<u8>,
}

impl Seen {
    /// Adds one result of the decoder.
    pub fn note(&mut self, decoded: Decoded<'_>, sender: Sender) {
        match (decoded, sender) {
            (Decoded::Text(byte), _) => self.text.push(byte),
            (Decoded::Dropped(dropped), _) => self.messages.push(format!("{:?}", dropped.cause)),
            (Decoded::Frame(body), Sender::Host) => {
                self.messages.push(in_words(Command::parse(body)));
            }
            (Decoded::Frame(body), Sender::Unit) => {
                self.messages.push(in_words(Reply::parse(body)));
            }
        }
    }
}

fn in_words(parsed: Result<impl std::fmt::Debug, ser_proto::ParseError>) -> String {
    match parsed {
        Ok(message) => format!("{message:?}"),
        Err(error) => format!("{error:?}"),
    }
}

/// Decodes pieces of a stream as they come.
#[must_use]
pub fn decode<'a>(pieces: impl IntoIterator<Item = &'a [u8]>, sender: Sender) -> Seen {
    let mut decoder = FrameDecoder::<{ ser_proto::MAX_BODY_LEN }>::new();
    let mut seen = Seen::default();
    for mut piece in pieces {
        while let Some(decoded) = decoder.push_slice(&mut piece) {
            seen.note(decoded, sender);
        }
    }
    seen
}
