//! The whole recorder in virtual time, against a model made of a few plain vectors.

mod bench;
mod genius;
mod model;
mod over_bus;
mod prompt_board;

use chrono::{DateTime, NaiveDateTime};
use ser_node::Debounce;
use ser_proto::{Command, Model};
use ser_sim::{LineRate, MemoryStorage, NonVolatile, PoweredOff, Ram, SimNodeOptions, SimRtc};

use super::framing::frame_of;
use super::script::Script;
use bench::{Bench, Host};
use model::Recorder;

/// How often the power is cut at most.
const MAX_POWER_CYCLES: u32 = 8;

/// `data` first says which model the recorder is, what debounce times it has, whether it is on a
/// bus, with or without the interrupt line, and what its clock shows. Then it says what happens:
/// contacts move; bytes, commands and datagrams arrive; the UART misreads a byte; time passes, with
/// or without the main loop; the power goes.
///
/// - What the node says is what the model says, to the byte and in its millisecond: every reply,
///   report and line.
/// - The log is that of the model, with stamps by the model's clock.
/// - What was refused is counted.
/// - Commands in datagrams are answered in the same way, and count from the millisecond of their
///   pulse, or of the look that sees their flag. Auto reports bring every event once. Global data
///   are the inputs.
/// - The log is the same when the host is slow and the line has its real rate. What is said is
///   always a whole message.
///
/// # Panics
/// When one of these does not hold.
pub fn node(data: &[u8]) {
    let mut script = Script::new(data);
    let setup = Setup::new(&mut script);
    let mut model = Recorder::new(setup.model, setup.debounce_ms, setup.rtc);
    let mut ram = Ram::new();
    let mut off = PoweredOff::new(setup.options());
    let mut inputs = 0;
    for _ in 0..MAX_POWER_CYCLES {
        model.power_cycle(inputs);
        let node = off.power_up(&mut ram);
        let mut bench = Bench::new(node, &mut model, setup.host, inputs, setup.bytes_per_ms());
        if setup.is_on_bus {
            bench = bench.on_bus(setup.has_line);
        }
        while !script.is_over() && !bench.is_over() {
            if act(&mut bench, &mut script, setup.host) == Power::Goes {
                break;
            }
        }
        bench.check_diagnostics();
        if script.is_over() {
            return assert_log(&mut bench);
        }
        inputs = bench.inputs();
        off = bench.node.power_off();
    }
}

/// A recorder and its surroundings.
struct Setup {
    model: Model,
    host: Host,
    is_on_bus: bool,
    has_line: bool,
    debounce_ms: [u8; 32],
    rtc: NaiveDateTime,
}

impl Setup {
    fn new(script: &mut Script<'_>) -> Setup {
        let bits = script.byte();
        let mut debounce_ms = [0; 32];
        if bits & 4 != 0 {
            debounce_ms = [script.byte(); 32];
        }
        if bits & 8 != 0 {
            for time_ms in debounce_ms.iter_mut().step_by(3) {
                *time_ms = script.byte();
            }
        }
        // Any moment of the century, most often near its end.
        let end_ms = 36_525 * 86_400_000;
        let time_ms = if bits & 0x10 == 0 {
            end_ms - i64::from(script.word())
        } else {
            i64::from(script.double_word()) * 734
        };
        // A command over the bus is carried out a few milliseconds later, and no contact may move
        // at that time.
        let host = if bits & 2 == 0 { Host::Prompt } else { Host::Slow };
        let is_on_bus = bits & 0x20 != 0 && host == Host::Prompt && debounce_ms == [0; 32];
        Setup {
            model: if bits & 1 == 0 { Model::Ser160 } else { Model::Ser320 },
            host,
            is_on_bus,
            has_line: bits & 0x40 != 0,
            debounce_ms,
            rtc: DateTime::from_timestamp_millis(time_ms).expect("within the century").naive_utc(),
        }
    }

    fn options(&self) -> SimNodeOptions {
        let debounce = (1..=32)
            .zip(self.debounce_ms)
            .fold(Debounce::OFF, |debounce, (number, time_ms)| debounce.with(number, time_ms));
        SimNodeOptions {
            debounce,
            line_rate: if self.host == Host::Slow { LineRate::Real } else { LineRate::Unlimited },
            non_volatile: NonVolatile {
                storage: MemoryStorage::default(),
                rtc: SimRtc::held_at(self.rtc),
                id: None,
            },
            ..SimNodeOptions::new(self.model)
        }
    }

    /// Debounce remembers what was in force as far back as the fastest line can change it.
    fn bytes_per_ms(&self) -> Option<u32> {
        self.debounce_ms.iter().any(|&time_ms| time_ms > 0).then_some(2)
    }
}

#[derive(PartialEq, Eq)]
enum Power {
    Stays,
    Goes,
}

/// Lets something happen.
fn act(bench: &mut Bench<'_, '_>, script: &mut Script<'_>, host: Host) -> Power {
    match script.byte() % 12 {
        0 => bench.pass(script.byte().into()),
        1 => bench.toggle(script.double_word()),
        2 => bench.toggle(1 << (script.byte() % 32)),
        3 => {
            let (index, times) = (script.byte() % 32, script.byte());
            (0..times).for_each(|_| bench.toggle(1 << index));
        }
        4 if host == Host::Prompt => bench.receive(script.run()),
        5 => bench.line_error(),
        6 => return Power::Goes,
        7 => {
            bench.pass(u32::from(script.word() % 2048));
            bench.hear();
        }
        8 => {
            let command = Command::Read { start: script.word() % 2050, count: script.byte() };
            bench.receive(&frame_of(&command.to_body()));
        }
        9 => {
            let body = body(script);
            if host == Host::Prompt || is_free_of_order(body) {
                bench.receive(&frame_of(body));
            }
        }
        10 => bench.ask_over_bus(script.byte() % 32, body(script)),
        _ => match script.byte() {
            table @ 0..=7 => bench.ask_forces(script.byte() % 32, table),
            8..=15 => {
                let (for_ms, contacts) = (script.byte(), script.byte());
                bench.broadcast_while_away(script.byte() % 32, body(script), for_ms, contacts);
            }
            _ => bench.broadcast(script.byte() % 32, body(script)),
        },
    }
    Power::Stays
}

fn body<'a>(script: &mut Script<'a>) -> &'a [u8] {
    let len = usize::from(script.byte() % 18);
    script.take(len)
}

/// Whether the log is the same whenever the command is carried out after its arrival, and everything
/// is said without hours of waiting.
fn is_free_of_order(body: &[u8]) -> bool {
    match Command::parse(body) {
        Ok(Command::Configure(configure)) => configure.size.is_none() && configure.baud.is_none(),
        Ok(command) => {
            !matches!(command, Command::Erase | Command::Print { .. } | Command::SetFilter { .. })
        }
        Err(_) => false,
    }
}

/// Reads the whole log. Each part is compared as it arrives.
fn assert_log(bench: &mut Bench<'_, '_>) {
    bench.settle();
    bench.check_global_data();
    for start in (1..=bench.model.len() + 1).step_by(10) {
        let start = u16::try_from(start).expect("no log is so long");
        bench.ask(&frame_of(&Command::Read { start, count: 10 }.to_body()));
    }
    bench.check_diagnostics();
}
