//! The bytes of a small image, as the linker would leave it.

/// Where its functions are.
const CODE: u32 = 0x100;

/// The memory with the stack.
const STACK: std::ops::Range<u32> = 0x2000_0000..0x2000_0100;

struct Section {
    name: &'static str,
    kind: u32,
    flags: u32,
    address: u32,
    bytes: Vec<u8>,
    /// Only the table of symbols has this.
    link: u32,
    entry: u32,
}

const PROGRAM: u32 = 1;
const SYMBOLS: u32 = 2;
const STRINGS: u32 = 3;
const RESERVED: u32 = 8;
const WRITE: u32 = 1;
const ALLOCATE: u32 = 2;
const FUNCTION: u8 = 2;

/// Sections are numbered from one; this is the one with the code.
const IN_CODE: u16 = 2;
const ABSOLUTE: u16 = 0xFFF1;

/// Reset calls a function that pushes two registers and branches by a table. Another function ends
/// the program on purpose.
fn code() -> Vec<u8> {
    let halfwords: [u16; 16] = [
        0xB510, 0xF000, 0xF803, 0xBD10, // Reset: push; bl work; pop
        0xDE00, 0xBF00, // force: udf; nop
        0xB510, 0xE8DF, 0xF000, 0x0201, 0x4801, 0x4780,
        0xBD10, // work: push; tbb; ldr; blx; pop
        0xBF00, 0x0109, 0x0000, // the word 0000_0109h
    ];
    halfwords.iter().flat_map(|halfword| halfword.to_le_bytes()).collect()
}

const NAMES: [Symbol; 9] = [
    ("$t", CODE, 0, 0, IN_CODE),
    ("$d", CODE + 0x12, 0, 0, IN_CODE),
    ("$t", CODE + 0x14, 0, 0, IN_CODE),
    ("$d", CODE + 0x1C, 0, 0, IN_CODE),
    ("Reset", CODE + 1, 8, FUNCTION, IN_CODE),
    ("ser_mps2_an385::forced::force", CODE + 9, 4, FUNCTION, IN_CODE),
    ("work", CODE + 0xD, 20, FUNCTION, IN_CODE),
    ("_stack_start", STACK.end, 0, 0, ABSOLUTE),
    ("_stack_end", STACK.start, 0, 0, ABSOLUTE),
];

fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn length(bytes: &[u8]) -> u32 {
    u32::try_from(bytes.len()).expect("a short file")
}

/// Name, value, size, kind, section.
type Symbol = (&'static str, u32, u32, u8, u16);

/// The symbols and the strings with their names.
fn symbols(names: &[Symbol]) -> (Vec<u8>, Vec<u8>) {
    let (mut symbols, mut strings) = (vec![0; 16], vec![0]);
    for &(name, value, size, kind, section) in names {
        symbols.extend(words(&[length(&strings), value, size]));
        symbols.extend([kind, 0]);
        symbols.extend(section.to_le_bytes());
        strings.extend(name.bytes().chain([0]));
    }
    (symbols, strings)
}

fn sections(code: Vec<u8>, names: &[Symbol]) -> Vec<Section> {
    let plain = |name, kind, flags, address, bytes| Section {
        name,
        kind,
        flags,
        address,
        bytes,
        link: 0,
        entry: 0,
    };
    let (symbols, strings) = symbols(names);
    let vectors = words(&[STACK.end, CODE | 1]);
    vec![
        plain(".vector_table", PROGRAM, ALLOCATE, 0, vectors),
        plain(".text", PROGRAM, ALLOCATE, CODE, code),
        plain(".bss", RESERVED, ALLOCATE | WRITE, STACK.end, vec![0; 64]),
        Section { link: 5, entry: 16, ..plain(".symtab", SYMBOLS, 0, 0, symbols) },
        plain(".strtab", STRINGS, 0, 0, strings),
    ]
}

/// An image for `mps2-an385` that may be flashed.
pub(crate) fn image() -> Vec<u8> {
    file(sections(code(), &NAMES))
}

/// An image with `count` functions, each of which calls the next one and then returns.
pub(crate) fn image_of_calls(count: u32) -> Vec<u8> {
    // push; bl to what comes after pop; pop
    let one: [u16; 4] = [0xB510, 0xF000, 0xF801, 0xBD10];
    let one: Vec<u8> = one.iter().flat_map(|halfword| halfword.to_le_bytes()).collect();
    let mut code = one.repeat(count as usize);
    code.extend(0x4770_u16.to_le_bytes());
    let each = (0..=count).map(|number| ("Reset", (CODE + number * 8) | 1, 8, FUNCTION, IN_CODE));
    let others = NAMES.iter().copied().filter(|(name, ..)| *name == "$t" || name.starts_with('_'));
    let others = others.filter(|&(_, value, ..)| value <= CODE || value >= STACK.start);
    file(sections(code, &others.chain(each).collect::<Vec<_>>()))
}

fn file(mut sections: Vec<Section>) -> Vec<u8> {
    const HEADER: u32 = 52;
    let mut names = vec![0];
    let mut contents = Vec::new();
    let mut headers = vec![0; 40];
    sections.push(Section {
        name: ".shstrtab",
        kind: STRINGS,
        flags: 0,
        address: 0,
        bytes: Vec::new(),
        link: 0,
        entry: 0,
    });
    let all: Vec<u32> = sections
        .iter()
        .map(|section| {
            let at = length(&names);
            names.extend(section.name.bytes().chain([0]));
            at
        })
        .collect();
    if let Some(last) = sections.last_mut() {
        last.bytes = names;
    }
    for (section, name) in sections.iter().zip(all) {
        let Section { kind, flags, address, bytes, link, entry, .. } = section;
        let at = HEADER + length(&contents);
        headers.extend(words(&[
            name,
            *kind,
            *flags,
            *address,
            at,
            length(bytes),
            *link,
            1,
            4,
            *entry,
        ]));
        if *kind != RESERVED {
            contents.extend(bytes);
            contents.resize(contents.len().next_multiple_of(4), 0);
        }
    }
    let mut file = vec![0x7F, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 40, 0];
    file.extend(words(&[1, CODE | 1, 0, HEADER + length(&contents), 0x0500_0000]));
    for halfword in [52u16, 0, 0, 40, 7, 6] {
        file.extend(halfword.to_le_bytes());
    }
    file.extend(contents);
    file.extend(headers);
    file
}
