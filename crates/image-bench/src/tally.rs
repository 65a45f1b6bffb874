//! Counts instructions as they are executed: per run of a handler, per pass of the main loop, and
//! while interrupts are masked.
//!
//! # Design
//! A handler begins with its first instruction, which nobody calls, and ends with a return that
//! belongs to no call inside of it. Instructions of a handler of higher priority count for that
//! handler alone. A pass of the main loop goes from the place to which it jumps after its sleep to
//! the same place again.
//!
//! # Notes
//! Entry and exit of an exception take a dozen cycles each and are not instructions.

use super::program::{Handler, Kind, Program};

/// One pass of the main loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pass {
    /// What it did itself.
    pub instructions: u64,
    /// What the receive and transmit handlers did meanwhile.
    pub serial: u64,
    /// Whether a sample was taken since the pass before began.
    pub after_sample: bool,
}

/// One run of a handler.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// Which handler.
    pub handler: Handler,
    /// The count of all instructions when it began.
    pub began: u64,
    /// What it did itself.
    pub instructions: u64,
}

/// Instructions in a row with all interrupts masked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Masked {
    /// How many.
    pub instructions: u64,
    /// Address of the one that masks.
    pub at: u32,
}

/// A handler that has begun.
struct Frame {
    run: Run,
    /// Calls inside of it that have not returned.
    depth: u32,
}

/// The counts.
pub struct Tally<'p> {
    program: &'p Program,
    total: u64,
    frames: Vec<Frame>,
    latest: Option<u32>,
    /// Whether the latest instruction may have ended a handler.
    leaving: bool,
    head: Head,
    pass: Option<Pass>,
    masked: Option<Masked>,
    /// Runs of handlers that have ended, in that order.
    pub runs: Vec<Run>,
    /// Passes of the main loop that have ended.
    pub passes: Vec<Pass>,
    /// The longest stretch in which interrupts were masked.
    pub longest_masked: Masked,
    /// How often interrupts were masked.
    pub times_masked: u64,
}

/// Where the main loop begins.
#[derive(Clone, Copy)]
enum Head {
    /// The main loop has not slept yet.
    Unknown,
    /// The main loop has slept, by the instruction at this address. It goes on to where that
    /// instruction, or the branch after it, leads.
    Behind(u32),
    Known(u32),
}

impl<'p> Tally<'p> {
    /// A tally that has counted nothing.
    #[must_use]
    pub fn new(program: &'p Program) -> Tally<'p> {
        Tally {
            program,
            total: 0,
            frames: Vec::new(),
            latest: None,
            leaving: false,
            head: Head::Unknown,
            pass: None,
            masked: None,
            runs: Vec::new(),
            passes: Vec::new(),
            longest_masked: Masked::default(),
            times_masked: 0,
        }
    }

    /// How many instructions were executed so far.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Forgets the runs and passes that have ended, but not those under way.
    pub fn begin_anew(&mut self) {
        self.runs.clear();
        self.passes.clear();
        self.longest_masked = Masked::default();
        self.times_masked = 0;
    }

    /// The instruction at `address` is executed.
    pub fn executed(&mut self, address: u32) {
        let kind = self.program.kind(address);
        if std::mem::take(&mut self.leaving) && !self.is_next(address) {
            self.leave();
        }
        match kind {
            Kind::Entry(handler) => self.enter(handler),
            Kind::Mask if self.masked.is_none() => {
                self.masked = Some(Masked { instructions: 0, at: address });
            }
            _ if self.frames.is_empty() => self.follow_main_loop(address, kind),
            _ => {}
        }
        self.count(kind);
        self.latest = Some(address);
    }

    /// Whether the latest instruction did not branch, as a return whose condition did not hold.
    fn is_next(&self, address: u32) -> bool {
        self.latest.is_some_and(|latest| self.program.behind(latest) == address)
    }

    fn enter(&mut self, handler: Handler) {
        let run = Run { handler, began: self.total, instructions: 0 };
        self.frames.push(Frame { run, depth: 0 });
    }

    fn leave(&mut self) {
        let Some(Frame { run, .. }) = self.frames.pop() else { return };
        if let Some(pass) = &mut self.pass {
            match run.handler {
                Handler::Capture => pass.after_sample = true,
                Handler::Receive | Handler::Transmit => pass.serial += run.instructions,
            }
        }
        self.runs.push(run);
    }

    fn follow_main_loop(&mut self, address: u32, kind: Kind) {
        match self.head {
            Head::Unknown if kind == Kind::Sleep => self.head = Head::Behind(address),
            Head::Behind(at) if self.program.behind(at) == address => {
                self.head = Head::Behind(address);
            }
            Head::Behind(_) => {
                self.head = Head::Known(address);
                self.pass = Some(Pass::default());
            }
            Head::Known(head) if head == address => {
                self.passes.extend(self.pass.replace(Pass::default()));
            }
            _ => {}
        }
    }

    fn count(&mut self, kind: Kind) {
        self.total += 1;
        if let Some(masked) = &mut self.masked {
            masked.instructions += 1;
            if kind == Kind::Unmask {
                self.times_masked += 1;
                if masked.instructions > self.longest_masked.instructions {
                    self.longest_masked = *masked;
                }
                self.masked = None;
            }
        }
        match self.frames.last_mut() {
            Some(frame) => {
                frame.run.instructions += 1;
                match kind {
                    Kind::Call => frame.depth += 1,
                    Kind::Return if frame.depth == 0 => self.leaving = true,
                    Kind::Return => frame.depth -= 1,
                    _ => {}
                }
            }
            None => {
                if let Some(pass) = &mut self.pass {
                    pass.instructions += 1;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Main loop at 100h: NOP, CPSID I, CPSIE I, WFI, MOV, B back to 100h. Capture at 200h: PUSH,
    /// BL 210h, POP {PC}. Its function at 210h: BX LR. Receive at 220h: NOP, BX LR.
    fn program() -> Program {
        let mut code = vec![0xBF00; 0x140 / 2];
        let mut put = |at: usize, halfwords: &[u16]| {
            code[(at - 0x100) / 2..][..halfwords.len()].copy_from_slice(halfwords);
        };
        put(0x100, &[0xBF00, 0xB672, 0xB662, 0xBF30, 0x4601, 0xE7F9]);
        put(0x200, &[0xB500, 0xF000, 0xF805, 0xBD00]);
        put(0x210, &[0x4770]);
        put(0x220, &[0xBF00, 0x4770]);
        Program::of_code(0x100, &code, &[(Handler::Capture, 0x200), (Handler::Receive, 0x220)])
    }

    const LOOP: [u32; 6] = [0x100, 0x102, 0x104, 0x106, 0x108, 0x10A];
    const CAPTURE: [u32; 4] = [0x200, 0x202, 0x210, 0x206];

    #[test]
    fn a_handler_counts_for_itself_and_a_pass_without_it() {
        let program = program();
        let mut tally = Tally::new(&program);
        let (before, after) = LOOP.split_at(1);
        let interrupted = [before, &CAPTURE, after].concat();
        for address in [&LOOP[..], &LOOP, &interrupted, &[0x100]].concat() {
            tally.executed(address);
        }
        let runs: Vec<(u64, u64)> =
            tally.runs.iter().map(|run| (run.began, run.instructions)).collect();
        assert_eq!(runs, [(13, 4)]);
        let passes: Vec<(u64, bool)> =
            tally.passes.iter().map(|pass| (pass.instructions, pass.after_sample)).collect();
        assert_eq!(passes, [(6, false), (6, true)]);
        assert_eq!(
            (tally.times_masked, tally.longest_masked),
            (3, Masked { instructions: 2, at: 0x102 })
        );
    }

    #[test]
    fn a_handler_of_higher_priority_and_one_right_behind_another_count_apart() {
        let program = program();
        let mut tally = Tally::new(&program);
        // Receive is interrupted by capture. Then capture runs, and receive right after it.
        let nested = [&[0x220][..], &CAPTURE, &[0x222]].concat();
        for address in [&LOOP[..], &nested, &CAPTURE, &[0x220, 0x222], &LOOP, &[0x100]].concat() {
            tally.executed(address);
        }
        let runs: Vec<(Handler, u64)> =
            tally.runs.iter().map(|run| (run.handler, run.instructions)).collect();
        assert_eq!(
            runs,
            [
                (Handler::Capture, 4),
                (Handler::Receive, 2),
                (Handler::Capture, 4),
                (Handler::Receive, 2)
            ]
        );
    }
}
