//! All results as a table, compared with the budgets.

use std::fmt;

use crate::lockstep::INSTRUCTIONS_PER_MS;
use ser_board::budget::{CAPTURE_INSTRUCTIONS, MAIN_LOOP_STALL_MS};

use super::bench::{Parts, RATE};
use super::costs::{
    self, Change, Commands, Cost, LONGEST_DEBOUNCE_MS, SHORTEST_DEBOUNCE_MS, Way, runs_of,
};
use super::lateness::Lateness;
use super::load::{Account, Load};
use super::program::{Handler, Program};
use super::tally::Masked;
use ser_trial::digits::grouped;

/// How many instructions of the main loop the rings in front of it cover. No pass may take longer.
pub const PASS_BUDGET: u64 = MAIN_LOOP_STALL_MS as u64 * INSTRUCTIONS_PER_MS;

/// How many instructions the capture interrupt may be late, and for how many interrupts may be
/// masked under load.
const LATENESS_BUDGET: u64 = 0;

/// How long the interrupt is measured with nothing else going on, in milliseconds.
const QUIET_MS: u64 = 5_000;

/// How busy the ports are when lateness is measured.
const PORTS: [&str; 2] = ["both ports quiet", "both ports busy"];

/// What was measured.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Report {
    /// Runs of the capture interrupt.
    pub capture: Vec<Capture>,
    /// What commands cost on RS-232 and on Genius.
    pub commands: Vec<(&'static str, [Cost; 2])>,
    /// A pass with nothing to do, without and with a GENI board.
    pub idle_passes: [u64; 2],
    /// While the image starts, and under load, each with the function that masks.
    pub masked: [(Masked, String); 2],
    /// With both ports quiet, and with both busy, on one board and measured by the same expiry of
    /// the timer.
    pub lateness: [Lateness; 2],
    /// Under load.
    pub load: Loaded,
}

/// What runs of the capture interrupt cost, in instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capture {
    /// What the inputs do.
    pub what: &'static str,
    /// Without debounce.
    pub without: u64,
    /// With this debounce time of all inputs, in milliseconds.
    pub with: (u8, u64),
}

impl Capture {
    fn measure(
        what: &'static str,
        debounce_ms: u8,
        cost: impl Fn(u8) -> Result<u64, String>,
    ) -> Result<Capture, String> {
        Ok(Capture { what, without: cost(0)?, with: (debounce_ms, cost(debounce_ms)?) })
    }

    fn most(&self) -> u64 {
        self.without.max(self.with.1)
    }
}

/// The results of a load.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// How long all inputs changed in every millisecond.
    pub ms: u64,
    /// The longest run of the capture interrupt.
    pub capture: u64,
    /// The longest pass of the main loop.
    pub pass: u64,
    /// Instructions of all interrupt handlers, and of the main loop in passes that did more than
    /// look for something to do, in thousandths of all.
    pub busy_per_mille: [u64; 2],
    /// What became of the events.
    pub account: Account,
}

impl Report {
    /// Measures everything. `load_ms` is how long the load lasts. `next` is told what is measured
    /// next.
    ///
    /// # Errors
    /// When the board does not do what it must.
    pub fn measure(parts: &Parts, load_ms: u64, next: &dyn Fn(&str)) -> Result<Report, String> {
        let program = &Program::read(&parts.image)?;
        next("capture interrupt");
        let mut capture = Vec::new();
        for change in Change::ALL {
            let cost = |debounce_ms| costs::capture(parts, program, change, debounce_ms);
            capture.push(Capture::measure(words(change), LONGEST_DEBOUNCE_MS, cost)?);
        }
        let cost = |debounce_ms| costs::capture_beyond_queue(parts, program, debounce_ms);
        capture.push(Capture::measure("all 32, and the queue full", SHORTEST_DEBOUNCE_MS, cost)?);
        next("commands");
        let mut ways = [Way::Line, Way::Bus].map(|way| Commands::start(parts, program, way));
        let [Ok(line), Ok(bus)] = &mut ways else {
            return ways.into_iter().find_map(Result::err).map_or(Err(String::new()), Err);
        };
        let mut commands = Vec::new();
        for (name, command) in costs::commands() {
            commands.push((name, [line.cost(&command)?, bus.cost(&command)?]));
        }
        let idle_passes = [line.idle_pass(), bus.idle_pass()];
        drop(ways);
        let at_start = costs::masked_at_start(parts, program)?;
        next("ports quiet, then busy with all inputs changing in every millisecond");
        let (lateness, under_load, load) = loaded(parts, program, load_ms, idle_passes[1])?;
        let named = |masked: Masked| (masked, program.name(masked.at).to_owned());
        let masked = [at_start, under_load].map(named);
        Ok(Report { capture, commands, idle_passes, masked, lateness, load })
    }

    /// The longest pass of the main loop, and in which command; `None` when it was under load.
    fn longest_pass(&self) -> (u64, Option<&str>) {
        let passes = self
            .commands
            .iter()
            .flat_map(|&(name, costs)| costs.map(|cost| (cost.longest_pass, Some(name))));
        passes.chain([(self.load.pass, None)]).max_by_key(|&(pass, _)| pass).unwrap_or_default()
    }

    /// Everything that is not as it must be.
    #[must_use]
    pub fn wrong(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        let mut keep = |what: &str, instructions: u64, budget: u64| {
            if instructions > budget {
                wrong.push(format!(
                    "{what}: {} of {} instructions",
                    grouped(instructions),
                    grouped(budget)
                ));
            }
        };
        for capture in &self.capture {
            keep(
                &format!("capture interrupt, {}", capture.what),
                capture.most(),
                CAPTURE_INSTRUCTIONS,
            );
        }
        keep("capture interrupt under load", self.load.capture, CAPTURE_INSTRUCTIONS);
        keep("longest pass of the main loop", self.longest_pass().0, PASS_BUDGET);
        for (what, lateness) in PORTS.iter().zip(&self.lateness) {
            keep(&format!("capture interrupt late with {what}"), lateness.max(), LATENESS_BUDGET);
        }
        let (masked, name) = &self.masked[1];
        keep(
            &format!("interrupts masked under load, in {name}"),
            masked.instructions,
            LATENESS_BUDGET,
        );
        if !self.load.account.is_settled() {
            wrong.push(format!("events are unaccounted for: {:?}", self.load.account));
        }
        wrong
    }
}

/// The load: lateness, masking, and the rest.
fn loaded(
    parts: &Parts,
    program: &Program,
    ms: u64,
    idle_pass: u64,
) -> Result<([Lateness; 2], Masked, Loaded), String> {
    let mut load = Load::start(parts, program)?;
    load.rest_ms(QUIET_MS)?;
    let at_rest = load.bench.tally.total();
    load.run_ms(ms)?;
    load.bench.tell(false);
    let lateness = load.lateness();
    let tally = &load.bench.tally;
    let handlers: u64 = tally.runs.iter().map(|run| run.instructions).sum();
    let passes = || tally.passes.iter().map(|pass| pass.instructions);
    let main_loop: u64 = passes().filter(|&pass| pass > idle_pass).sum();
    let per_mille = |instructions: u64| instructions * 1000 / (tally.total() - at_rest).max(1);
    let capture = runs_of(tally, Handler::Capture).map(|run| run.instructions).max().unwrap_or(0);
    let (pass, masked) = (passes().max().unwrap_or(0), tally.longest_masked);
    let busy_per_mille = [per_mille(handlers), per_mille(main_loop)];
    let account = load.settle()?;
    Ok((lateness, masked, Loaded { ms, capture, pass, busy_per_mille, account }))
}

fn words(change: Change) -> &'static str {
    match change {
        Change::None => "nothing changes",
        Change::One => "one input changes",
        Change::All => "all 32 inputs change",
    }
}

fn mark(instructions: u64, budget: u64) -> &'static str {
    if instructions <= budget { "✓" } else { "✗ over budget" }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "Instructions of the image for mps2-an385, counted in the emulator\n")?;
        self.show_capture(f)?;
        self.show_commands(f)?;
        self.show_main_loop(f)?;
        self.show_lateness(f)?;
        self.show_load(f)?;
        writeln!(
            f,
            "\nInstructions are not cycles: a chip adds wait states of flash and bus, and a \
             dozen cycles to enter and leave an\n\
             interrupt. Virtual time has {} instructions a second. Budgets, and the reckoning \
             behind them, are in\n\
             crates/ser-board/src/budget.rs.",
            grouped(INSTRUCTIONS_PER_MS * 1000),
        )
    }
}

impl Report {
    fn show_capture(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<28}{:>12}{:>20}{:>9}",
            "Capture interrupt", "no debounce", "with debounce of", "budget"
        )?;
        for capture in &self.capture {
            let Capture { what, without, with: (debounce_ms, with) } = capture;
            let mark = mark(capture.most(), CAPTURE_INSTRUCTIONS);
            writeln!(
                f,
                "  {what:<26}{without:>12}{debounce_ms:>10} ms{with:>7}{CAPTURE_INSTRUCTIONS:>9}  {mark}"
            )?;
        }
        let under_load = self.load.capture;
        let mark = mark(under_load, CAPTURE_INSTRUCTIONS);
        writeln!(
            f,
            "  {:<26}{under_load:>12}{:>20}{CAPTURE_INSTRUCTIONS:>9}  {mark}",
            "the longest under load", ""
        )
    }

    fn show_commands(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n{:<30}{:<36}Genius", "Commands", "RS-232")?;
        let [a, b, c] = ["main loop", "interrupts", "longest pass"];
        writeln!(f, "  {:<24}{a:>12}{b:>11}{c:>13}{a:>12}{b:>11}{c:>13}", "beyond an idle board")?;
        for (name, costs) in &self.commands {
            write!(f, "  {name:<24}")?;
            for cost in costs {
                let [a, b, c] = [cost.main_loop, cost.handlers, cost.longest_pass].map(grouped);
                write!(f, "{a:>12}{b:>11}{c:>13}")?;
            }
            writeln!(f)?;
        }
        Ok(())
    }

    fn show_main_loop(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [without, with] = self.idle_passes.map(grouped);
        let (longest, command) = self.longest_pass();
        let mark = mark(longest, PASS_BUDGET);
        writeln!(f, "\nMain loop")?;
        writeln!(
            f,
            "  {:<26}{without:>12}  and {with} with a GENI board",
            "a pass with nothing to do"
        )?;
        let (name, longest, budget) =
            (command.unwrap_or("under load"), grouped(longest), grouped(PASS_BUDGET));
        writeln!(
            f,
            "  {:<26}{longest:>12}  {name}; {budget} are covered by the rings  {mark}",
            "the longest pass"
        )?;
        let pass = grouped(self.load.pass);
        writeln!(f, "  {:<26}{pass:>12}", "the longest under load")?;
        writeln!(f, "\nInterrupts masked, capture included")?;
        let words = |(masked, name): &(Masked, String)| match masked.instructions {
            0 => format!("{:>12}", "never"),
            count => format!("{:>12}  in {name}", grouped(count)),
        };
        let [start, load] = &self.masked;
        writeln!(f, "  {:<26}{}", "while the image starts", words(start))?;
        let mark = self::mark(load.0.instructions, LATENESS_BUDGET);
        writeln!(f, "  {:<26}{}  {mark}", "under load", words(load))
    }

    fn show_lateness(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\nCapture interrupt, instructions from its timer's expiry to the first of its own"
        )?;
        let heads = ["interrupts", "min", "p50", "p99", "p99.9", "max"];
        write!(f, "  {:<26}", "")?;
        let [count, ranks @ ..] = heads;
        write!(f, "{count:>12}")?;
        ranks.iter().try_for_each(|head| write!(f, "{head:>9}"))?;
        writeln!(f)?;
        for (row, lateness) in PORTS.iter().zip(&self.lateness) {
            write!(f, "  {row:<26}{:>12}", grouped(lateness.count() as u64))?;
            for per_mille in [0, 500, 990, 999, 1000] {
                write!(f, "{:>9}", grouped(lateness.per_mille(per_mille)))?;
            }
            writeln!(f, "  {}", mark(lateness.max(), LATENESS_BUDGET))?;
        }
        let [_, busy] = &self.lateness;
        write!(f, "  both ports busy, instructions late and how often:\n{busy}")
    }

    fn show_load(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Loaded { ms, busy_per_mille: [handlers, main_loop], account, .. } = &self.load;
        let Account { changes, total, hosts, carried, lasted_ms } = account;
        let percent = |per_mille: u64| format!("{}.{} %", per_mille / 10, per_mille % 10);
        writeln!(
            f,
            "\nLoad: all 32 inputs change in every millisecond for {} s, both hosts read all the \
             time",
            *ms / 1000
        )?;
        let total = total.map_or("nothing".to_owned(), |total| grouped(total.into()));
        writeln!(
            f,
            "  {:<26}{:>12}  the recorder's own total modulo 65,536 is {total}",
            "samples with a change",
            grouped(*changes)
        )?;
        for (name, told, talk) in hosts {
            let sum = told.delivered + told.overwritten;
            let mark = if sum == *changes { "✓ none missing" } else { "✗ some are missing" };
            let [delivered, overwritten, answered, reports] =
                [told.delivered, told.overwritten, talk.answered, talk.reports].map(grouped);
            writeln!(
                f,
                "  {name:<26}{delivered:>12} read once + {overwritten} reported as overwritten  {mark}; \
                 {answered} answers and {reports} reports"
            )?;
        }
        let [to, from] = [carried.to, carried.from].map(|bytes| grouped(bytes * 1000 / ms));
        let rate = grouped(RATE.into());
        writeln!(
            f,
            "  {:<26}{to:>12} to the board and {from} from it, of {rate} each",
            "bytes a second on RS-232"
        )?;
        writeln!(
            f,
            "  {:<26}{:>12} in interrupts, {} in the main loop's busy passes",
            "of all instructions",
            percent(*handlers),
            percent(*main_loop)
        )?;
        writeln!(f, "  {:<26}{:>12} ms after power-up", "all was read", grouped(*lasted_ms))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::Carried;
    use ser_trial::simulation::account::Tally as Told;
    use ser_trial::simulation::conversation::Talk;

    fn report() -> Report {
        let told = Told { delivered: 900, overwritten: 100, ..Told::default() };
        let host = |name| (name, told, Talk::default());
        let account = Account {
            changes: 1000,
            total: Some(1000),
            hosts: [host("RS-232"), host("Genius")],
            carried: Carried { to: 1900, from: 2 },
            lasted_ms: 3,
        };
        Report {
            capture: vec![Capture { what: "all 32 inputs change", without: 92, with: (255, 148) }],
            commands: vec![("E  erase", [Cost::default(); 2])],
            idle_passes: [661, 2772],
            masked: [(Masked::default(), String::new()), (Masked::default(), String::new())],
            lateness: [Lateness::default(), Lateness::default()],
            load: Loaded {
                ms: 1000,
                capture: 92,
                pass: 37_110,
                busy_per_mille: [57, 310],
                account,
            },
        }
    }

    #[test]
    fn what_keeps_to_the_budgets_is_not_wrong() {
        assert_eq!(report().wrong(), Vec::<String>::new());
        let text = report().to_string();
        assert!(text.contains("92       255 ms    148      150  ✓"), "{text}");
        assert!(text.contains("37,110") && text.contains("5.7 %") && !text.contains('✗'), "{text}");
    }

    #[test]
    fn what_is_over_budget_or_missing_is_wrong_and_shown() {
        let mut report = report();
        report.capture[0].with.1 = 151;
        report.commands[0].1[1].longest_pass = PASS_BUDGET + 1;
        report.load.account.hosts[0].1.overwritten -= 1;
        let wrong = report.wrong();
        assert_eq!(wrong.len(), 3, "{wrong:?}");
        assert_eq!(wrong[0], "capture interrupt, all 32 inputs change: 151 of 150 instructions");
        assert_eq!(report.to_string().matches('✗').count(), 3);
    }

    #[test]
    fn one_late_sample_is_wrong_and_shown() {
        for (port, what) in PORTS.iter().enumerate() {
            let mut report = report();
            report.lateness[port] = Lateness::of(&[1_000, 2_000, 3_001], 0, 1_000);
            assert_eq!(
                report.wrong(),
                [format!("capture interrupt late with {what}: 1 of 0 instructions")]
            );
            assert_eq!(report.to_string().matches('✗').count(), 1, "{report}");
        }
    }

    #[test]
    fn masking_is_wrong_under_load_and_allowed_at_the_start() {
        let mut report = report();
        let masked = (Masked { instructions: 2, at: 0x102 }, "locks".to_owned());
        report.masked[0] = masked.clone();
        assert_eq!(report.wrong(), Vec::<String>::new());
        report.masked[1] = masked;
        assert_eq!(report.wrong(), ["interrupts masked under load, in locks: 2 of 0 instructions"]);
        assert_eq!(report.to_string().matches('✗').count(), 1, "{report}");
    }

    #[test]
    fn a_recorder_that_counts_other_events_than_there_were_is_wrong() {
        let cases = [
            (1000, Some(1000), true),
            (66_536, Some(1000), true),
            (1000, Some(999), false),
            (1000, None, false),
        ];
        for (changes, total, right) in cases {
            let mut account = report().load.account;
            account.hosts.iter_mut().for_each(|(_, told, _)| told.overwritten += changes - 1000);
            (account.changes, account.total) = (changes, total);
            assert_eq!(account.is_settled(), right, "{account:?}");
        }
    }
}
