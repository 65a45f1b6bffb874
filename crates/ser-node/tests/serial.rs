//! The recorder on its RS-232 line, as the manual describes it: bytes in, bytes out, in virtual
//! time.

mod bench;

use bench::{Bench, Survivors, TEN_O_CLOCK, changes, replies};
use ser_node::{Debounce, Diagnostics, VERSION};
use ser_proto::{
    AutoReport, Baud, Command, Configuration, FrameEncoder, Inputs, Mode, Model, Reply, TimeStamp,
};

// Recording

#[test]
fn inputs_that_change_in_the_same_millisecond_share_an_entry() {
    let mut bench = Bench::new(Model::Ser160);
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.contacts(0b0011);
    bench.pass_ms(9);
    bench.contacts(0b1001);
    let reply = bench.read(1, 10);
    assert_eq!(
        changes(&reply),
        [
            (0b0011, 0b0011, "2026-11-22T10:00:00.001".to_owned()),
            (0b1010, 0b1001, "2026-11-22T10:00:00.011".to_owned()),
        ]
    );
    assert_eq!((reply.total, reply.next_slot, reply.model), (2, 2, Some(Model::Ser160)));
}

#[test]
fn thirty_two_inputs_come_with_sixteen_byte_entries() {
    let mut bench = Bench::new(Model::Ser320);
    bench.contacts(0x8000_0001);
    let reply = bench.read(1, 1);
    assert_eq!(reply.model, Some(Model::Ser320));
    assert_eq!(reply.entries[0].changed, Inputs(0x8000_0001));
}

#[test]
fn the_state_at_power_up_is_the_baseline() {
    for debounce in [Debounce::OFF, Debounce::uniform(5)] {
        for inputs in [0, 0b1010, 0xFFFF] {
            let survivors = Survivors::default();
            let mut bench = Bench::powered_up(Model::Ser160, debounce, 2048, survivors, inputs);
            bench.pass_ms(20);
            assert_eq!(bench.read(1, 1).total, 0, "contacts that are found closed are no events");
            for state in [inputs ^ 1, inputs] {
                bench.contacts(state);
                bench.pass_ms(20);
            }
            let seen: Vec<_> = changes(&bench.read(1, 10))
                .iter()
                .map(|&(changed, state, _)| (changed, state))
                .collect();
            assert_eq!(seen, [(1, inputs ^ 1), (1, inputs)]);
        }
    }
}

#[test]
fn while_stopped_nothing_is_recorded_and_starting_takes_a_new_baseline() {
    let mut bench = Bench::new(Model::Ser160);
    let stopped = Reply::Mode(Mode { recording: false, version: VERSION });
    let started = Reply::Mode(Mode { recording: true, version: VERSION });
    assert_eq!(bench.ask(&Command::QueryMode), std::slice::from_ref(&started));
    assert_eq!(bench.ask(&Command::SetMode { recording: false }), std::slice::from_ref(&stopped));
    bench.contacts(0b01);
    assert_eq!(bench.ask(&Command::QueryMode), [stopped]);
    assert_eq!(bench.ask(&Command::SetMode { recording: true }), [started]);
    bench.pass_ms(5);
    assert_eq!(bench.read(1, 0).total, 0);
    bench.contacts(0b11);
    let reply = bench.read(1, 1);
    assert_eq!((reply.entries[0].changed.0, reply.entries[0].state.0), (0b10, 0b11));
}

#[test]
fn a_board_can_ask_for_what_its_lamps_tell() {
    let mut bench = Bench::new(Model::Ser160);
    let told =
        |bench: &Bench| (bench.node.is_recording(), bench.node.events(), bench.node.commands());
    assert_eq!(told(&bench), (true, 0, 0));
    bench.events(3);
    assert_eq!(told(&bench), (true, 3, 0));
    bench.ask(&Command::Erase);
    bench.ask(&Command::SetMode { recording: false });
    bench.events(2);
    bench.send(*b"\x1B015858");
    assert_eq!(
        told(&bench),
        (false, 3, 3),
        "erased events have happened, and refused commands have come"
    );
}

#[test]
fn a_contact_that_bounces_is_stamped_with_the_sample_from_which_it_held() {
    let mut bench = Bench::with(Model::Ser160, Debounce::uniform(20), 2048, Survivors::default());
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    // Closed at 1, 8 and 12 ms, and open in between, before it stays closed.
    for (inputs, ms) in [(1, 2), (0, 5), (1, 1), (0, 3), (1, 60)] {
        bench.inputs = inputs;
        bench.pass_ms(ms);
    }
    assert_eq!(changes(&bench.read(1, 10)), [(1, 1, "2026-11-22T10:00:00.012".to_owned())]);
}

#[test]
fn a_debounced_change_is_stamped_with_its_first_moment_and_recorded_by_the_mode_of_that_moment() {
    let mut bench = Bench::with(Model::Ser160, Debounce::uniform(20), 2048, Survivors::default());
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.contacts(1);
    bench.pass_ms(10);
    // Recording stops and the clock is set while the change waits for its debounce time.
    bench.ask(&Command::SetMode { recording: false });
    bench.ask(&Command::SetClock(TimeStamp { hour: 23, ..TEN_O_CLOCK }));
    bench.pass_ms(30);
    let reply = bench.read(1, 10);
    assert_eq!(changes(&reply), [(1, 1, "2026-11-22T10:00:00.001".to_owned())]);
}

#[test]
fn each_change_is_judged_by_what_was_in_force_in_its_millisecond() {
    let mut bench = Bench::with(Model::Ser160, Debounce::uniform(20), 2048, Survivors::default());
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.contacts(0b01);
    // All of this while the change waits for its debounce time.
    for hour in [22, 23] {
        bench.pass_ms(3);
        bench.ask(&Command::SetClock(TimeStamp { hour, ..TEN_O_CLOCK }));
        bench.ask(&Command::SetMode { recording: hour == 23 });
    }
    bench.pass_ms(60);
    assert_eq!(changes(&bench.read(1, 10)), [(0b01, 0b01, "2026-11-22T10:00:00.001".to_owned())]);
}

#[test]
fn a_change_in_the_millisecond_in_which_the_clock_is_set_came_before_it() {
    for debounce in [Debounce::OFF, Debounce::uniform(5)] {
        let mut bench = Bench::with(Model::Ser160, debounce, 2048, Survivors::default());
        bench.contacts(1);
        bench.ask(&Command::SetClock(TEN_O_CLOCK));
        bench.pass_ms(60);
        assert_eq!(bench.read(1, 1).entries[0].time.to_string(), "2000-01-01T00:00:00.002");
    }
}

#[test]
fn stamps_go_on_where_the_tick_wraps() {
    let mut bench = Bench::new(Model::Ser160);
    for tick_ms in [0x7000_0000, 0xE000_0000, u32::MAX - 3] {
        bench.tick_ms = tick_ms;
        bench.pass_ms(1);
    }
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.tick_ms -= 1;
    for ms in 1..=9 {
        bench.tick_ms = (u32::MAX - 2).wrapping_add(ms);
        bench.inputs ^= 1;
        bench.capture.sample(bench.tick_ms, bench.inputs);
        bench.node.poll(bench.tick_ms);
    }
    let stamps: Vec<_> =
        bench.read(1, 10).entries.iter().map(|entry| entry.time.millisecond).collect();
    assert_eq!(stamps, (1..=9).collect::<Vec<_>>());
}

#[test]
fn inputs_that_the_model_does_not_have_are_no_event() {
    let mut bench = Bench::new(Model::Ser160);
    bench.contacts(0x0001_0000);
    assert_eq!(bench.read(1, 1).total, 0);
    bench.contacts(0x8001_8000);
    let reply = bench.read(1, 1);
    assert_eq!((reply.entries[0].changed.0, reply.entries[0].state.0), (0x8000, 0x8000));
}

// R: read entries

#[test]
fn commands_that_come_in_a_row_are_answered_as_if_they_had_come_one_by_one() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(13);
    bench.send(FrameEncoder::new(Command::Read { start: 1, count: 10 }.to_body()));
    bench.send(FrameEncoder::new(Command::Read { start: 11, count: 10 }.to_body()));
    bench.send(FrameEncoder::new(Command::Erase.to_body()));
    bench.send(FrameEncoder::new(Command::SetMode { recording: false }.to_body()));
    bench.send(FrameEncoder::new(Command::SetMode { recording: true }.to_body()));
    let replies = replies(&bench.line());
    let [Reply::Read(first), Reply::Read(second), Reply::Erased, stopped, started] = &replies[..]
    else {
        panic!("{replies:?}")
    };
    assert_eq!((first.entries.len(), second.entries.len(), second.total), (10, 3, 13));
    assert_eq!(*stopped, Reply::Mode(Mode { recording: false, version: VERSION }));
    assert_eq!(*started, Reply::Mode(Mode { recording: true, version: VERSION }));
}

#[test]
fn a_read_out_of_range_is_answered_with_what_exists_and_counted() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(2);
    let refused = [(0, 10, 0), (2049, 1, 0), (1, 11, 2)];
    for (counted, (start, count, entries)) in (1..).zip(refused) {
        assert_eq!(bench.read(start, count).entries.len(), entries);
        assert_eq!(bench.diagnostics().parameters_refused, counted);
    }
    bench.ask(&Command::Print { start: 3000, count: 1 });
    assert_eq!(bench.diagnostics().parameters_refused, 4);
    // A read of entries that do not exist yet, or of none, is no mistake.
    bench.read(3, 10);
    bench.read(1, 0);
    assert_eq!(bench.diagnostics().parameters_refused, 4);
}

#[test]
fn a_read_past_the_last_used_entry_returns_what_exists() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(3);
    assert_eq!(bench.read(2, 10).entries.len(), 2);
    assert_eq!(bench.read(4, 10).entries.len(), 0);
    assert_eq!(bench.read(0, 10).entries.len(), 0);
    assert_eq!(bench.read(u16::MAX, 255).entries.len(), 0);
    let header = bench.read(1, 0);
    assert_eq!((header.start, header.total, header.next_slot, header.entries.len()), (1, 3, 3, 0));
}

#[test]
fn a_count_above_ten_gives_ten() {
    let mut bench = Bench::new(Model::Ser320);
    bench.events(20);
    assert_eq!(bench.read(1, 255).entries.len(), 10);
}

#[test]
fn a_read_does_not_wrap_around_the_ring() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| configuration.size = 8);
    bench.events(11);
    let reply = bench.read(6, 10);
    assert_eq!((reply.entries.len(), reply.total, reply.next_slot), (3, 11, 3));
}

#[test]
fn the_full_log_keeps_2048_events() {
    let mut bench = Bench::new(Model::Ser320);
    bench.events(2050);
    let reply = bench.read(2048, 10);
    assert_eq!((reply.entries.len(), reply.total, reply.next_slot), (1, 2050, 2));
}

// E: erase

#[test]
fn erase_empties_the_log_and_starts_counting_at_zero() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(5);
    bench.send(*b"\x1B014545");
    assert_eq!(bench.line(), b"\x1B014545");
    let reply = bench.read(1, 10);
    assert_eq!((reply.total, reply.next_slot, reply.entries.len()), (0, 0, 0));
}

// S: set clock

#[test]
fn the_clock_is_set_when_the_last_byte_arrives() {
    let mut bench = Bench::new(Model::Ser160);
    for byte in FrameEncoder::new(Command::SetClock(TEN_O_CLOCK).to_body()) {
        bench.pass_ms(1);
        bench.node.serial_receive(byte, bench.tick_ms);
    }
    assert_eq!(bench.line(), b"\x1B015353");
    bench.pass_ms(5);
    bench.contacts(1);
    assert_eq!(bench.read(1, 1).entries[0].time.to_string(), "2026-11-22T10:00:00.006");
}

#[test]
fn a_main_loop_that_comes_late_stamps_as_if_it_had_been_there() {
    let survivors = Survivors::default();
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors.clone());
    // Nobody polls for 100 ms: a change, the command at tick 51, another change.
    let arrival_ms = bench.tick_ms + 50;
    for ms in 1..=100 {
        let inputs = u32::from(ms >= 20) | u32::from(ms >= 70) << 1;
        bench.capture.sample(bench.tick_ms + ms, inputs);
    }
    bench.tick_ms += 100;
    for byte in FrameEncoder::new(Command::SetClock(TEN_O_CLOCK).to_body()) {
        bench.node.serial_receive(byte, arrival_ms);
    }
    // The battery-backed clock is set too. It shows the time from the moment at which it is
    // written.
    let now = survivors.clock.borrow().expect("was set");
    assert_eq!(TimeStamp::try_from(now), Ok(TimeStamp { millisecond: 50, ..TEN_O_CLOCK }));
    bench.node.poll(bench.tick_ms);
    assert_eq!(bench.line(), b"\x1B015353");
    assert_eq!(
        changes(&bench.read(1, 10)),
        [
            (0b01, 0b01, "2000-01-01T00:00:00.021".to_owned()),
            (0b10, 0b11, "2026-11-22T10:00:00.020".to_owned()),
        ]
    );
}

#[test]
fn an_impossible_date_is_refused_by_silence() {
    let mut bench = Bench::new(Model::Ser160);
    assert_eq!(bench.ask(&Command::SetClock(TimeStamp { month: 13, ..TEN_O_CLOCK })), []);
    assert_eq!(bench.diagnostics().parameters_refused, 1);
    bench.contacts(1);
    assert_eq!(bench.read(1, 1).entries[0].time.year, 0);
}

#[test]
fn the_clock_goes_on_after_a_power_cycle() {
    let survivors = Survivors::default();
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors.clone());
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors);
    bench.contacts(1);
    assert_eq!(bench.read(1, 1).entries[0].time.to_string(), "2026-11-22T10:00:00.002");
}

// C: configure

#[test]
fn the_manuals_configuration_example_is_answered_with_itself() {
    let mut bench = Bench::new(Model::Ser160);
    let example = *b"\x1B074304000602010050";
    bench.send(example);
    assert_eq!(bench.line(), example);
}

#[test]
fn a_query_shows_the_configuration_and_changes_nothing() {
    let mut bench = Bench::new(Model::Ser160);
    for _ in 0..2 {
        let defaults = Reply::Configuration(Configuration::default());
        assert_eq!(bench.ask(&Command::QueryConfiguration), [defaults]);
    }
}

#[test]
fn a_bad_field_leaves_the_whole_configuration_unchanged() {
    let mut bench = Bench::new(Model::Ser160);
    // 1024 entries would be allowed, but 40 is no report address.
    bench.send(*b"\x1B074304000602280077");
    assert_eq!(replies(&bench.line()), [Reply::Configuration(Configuration::default())]);
    assert_eq!(bench.diagnostics().parameters_refused, 1);
}

#[test]
fn a_size_beyond_the_memory_of_the_board_is_refused() {
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 100, Survivors::default());
    assert_eq!(bench.configure(|configuration| configuration.size = 101).size, 100);
    assert_eq!(bench.diagnostics().parameters_refused, 1);
    assert_eq!(bench.configure(|configuration| configuration.size = 99).size, 99);
}

#[test]
fn resizing_keeps_the_newest_events_from_slot_0_and_the_total() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| configuration.size = 10);
    bench.events(13);
    let before = bench.read(1, 10);
    bench.configure(|configuration| configuration.size = 4);
    let after = bench.read(1, 10);
    // The newest four stood in slots 9, 0, 1 and 2.
    let newest = [before.entries[9], before.entries[0], before.entries[1], before.entries[2]];
    assert_eq!(after.entries, newest);
    assert_eq!((after.total, after.next_slot), (13, 0));
}

#[test]
fn the_configuration_survives_a_power_cycle_and_the_log_does_not() {
    let survivors = Survivors::default();
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors.clone());
    let configuration = bench.configure(|configuration| {
        configuration.size = 300;
        configuration.report_address = 17;
    });
    bench.events(5);
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors);
    assert_eq!(bench.ask(&Command::QueryConfiguration), [Reply::Configuration(configuration)]);
    assert_eq!(bench.read(1, 10).total, 0);
}

#[test]
fn the_baud_rate_changes_after_the_reply() {
    let mut bench = Bench::new(Model::Ser160);
    assert_eq!(bench.node.baud(), Baud::B9600);
    let faster = Configuration { baud: Baud::B19200, ..Configuration::default() };
    bench.send(FrameEncoder::new(Command::Read { start: 1, count: 1 }.to_body()));
    bench.send(FrameEncoder::new(Command::Configure(faster.into()).to_body()));
    bench.send(FrameEncoder::new(Command::QueryMode.to_body()));
    assert_eq!(bench.node.baud_change(), None);
    let at_the_old_rate = replies(&bench.line());
    assert!(matches!(at_the_old_rate[..], [Reply::Read(_), Reply::Configuration(_)]));
    assert_eq!(bench.node.baud_change(), Some(Baud::B19200));
    assert_eq!(bench.line(), b"");
    bench.node.baud_changed(Baud::B19200);
    assert_eq!(bench.node.baud_change(), None);
    assert!(matches!(replies(&bench.line())[..], [Reply::Mode(_)]));
}

#[test]
fn the_baud_rate_changes_right_after_the_reply_whatever_waits_behind_it() {
    let mut bench = Bench::new(Model::Ser160);
    for baud in [Baud::B19200, Baud::B9600] {
        let configuration = Configuration { baud, ..Configuration::default() };
        bench.send(FrameEncoder::new(Command::Configure(configuration.into()).to_body()));
        bench.send(FrameEncoder::new(Command::QueryConfiguration.to_body()));
    }
    for (baud, replies_at_this_rate) in [(Baud::B19200, 1), (Baud::B9600, 2)] {
        assert_eq!(replies(&bench.line()).len(), replies_at_this_rate);
        assert_eq!(bench.node.baud_change(), Some(baud));
        bench.node.baud_changed(baud);
    }
    assert_eq!(replies(&bench.line()).len(), 1);
}

#[test]
fn a_configuration_that_could_not_be_stored_is_stored_when_it_is_sent_again() {
    let survivors = Survivors::default();
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors.clone());
    *survivors.write_protected.borrow_mut() = true;
    assert_eq!(bench.configure(|configuration| configuration.size = 7).size, 7);
    assert_eq!(bench.diagnostics().storage_errors, 1);
    *survivors.write_protected.borrow_mut() = false;
    assert_eq!(bench.configure(|configuration| configuration.size = 7).size, 7);
    assert_eq!(bench.diagnostics().storage_errors, 1);
    let mut bench = Bench::with(Model::Ser160, Debounce::OFF, 2048, survivors);
    assert_eq!(bench.configure(|_| ()).size, 7);
}

// Auto report

#[test]
fn a_report_from_a_full_ring_holds_new_events_only() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| {
        configuration.size = 8;
        configuration.auto_report = AutoReport::Rs232;
    });
    bench.events(8);
    bench.line();
    bench.events(2);
    let [Reply::Read(report)] = &replies(&bench.line())[..] else { panic!("no report") };
    assert_eq!((report.start, report.entries.len(), report.total), (1, 2, 10));
}

#[test]
fn erased_events_are_neither_reported_nor_printed() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| {
        configuration.auto_report = AutoReport::Rs232;
        configuration.auto_print = true;
    });
    bench.events(5);
    bench.send(FrameEncoder::new(Command::Print { start: 1, count: 5 }.to_body()));
    bench.send(FrameEncoder::new(Command::Erase.to_body()));
    assert!(matches!(replies(&bench.line())[..], [Reply::PrintAccepted, Reply::Erased]));
    bench.events(1);
    let lines = bench.line().iter().filter(|&&byte| byte == b'\n').count();
    assert_eq!(lines, 1);
}

#[test]
fn auto_report_sends_every_event_once_in_order() {
    let mut bench = Bench::new(Model::Ser320);
    bench.events(2);
    bench.configure(|configuration| configuration.auto_report = AutoReport::Rs232);
    assert_eq!(bench.line(), b"", "events from before are not reported");
    bench.events(1);
    let [Reply::Read(first)] = &replies(&bench.line())[..] else { panic!("no report") };
    assert_eq!((first.start, first.entries.len(), first.total), (3, 1, 3));
    assert_eq!(first.entries, bench.read(3, 1).entries);
    // Twelve more events came while the line was busy; ten go into one message.
    bench.events(12);
    let [Reply::Read(ten), Reply::Read(two)] = &replies(&bench.line())[..] else {
        panic!("no reports")
    };
    assert_eq!((ten.start, ten.entries.len(), two.start, two.entries.len()), (4, 10, 14, 2));
    assert_eq!(
        (&ten.entries, &two.entries),
        (&bench.read(4, 10).entries, &bench.read(14, 10).entries)
    );
    assert_eq!(bench.line(), b"");
}

#[test]
fn auto_report_goes_on_at_the_start_of_the_ring() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| {
        configuration.size = 5;
        configuration.auto_report = AutoReport::Rs232;
    });
    bench.events(4);
    bench.line();
    bench.events(3);
    let [Reply::Read(end), Reply::Read(start)] = &replies(&bench.line())[..] else {
        panic!("no reports")
    };
    assert_eq!((end.start, end.entries.len(), start.start, start.entries.len()), (5, 1, 1, 2));
}

#[test]
fn events_overwritten_before_they_were_reported_are_counted() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| {
        configuration.size = 5;
        configuration.auto_report = AutoReport::Rs232;
    });
    bench.events(12);
    let entries: usize = replies(&bench.line())
        .iter()
        .map(|reply| match reply {
            Reply::Read(reply) => reply.entries.len(),
            other => panic!("{other:?}"),
        })
        .sum();
    assert_eq!((entries, bench.diagnostics().events_unreported), (5, 7));
}

#[test]
fn a_reply_goes_before_a_report() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| configuration.auto_report = AutoReport::Rs232);
    bench.events(1);
    bench.send(FrameEncoder::new(Command::QueryMode.to_body()));
    assert!(matches!(replies(&bench.line())[..], [Reply::Mode(_), Reply::Read(_)]));
}

// Print

#[test]
fn auto_print_prints_one_line_per_event() {
    let mut bench = Bench::new(Model::Ser320);
    bench.ask(&Command::SetClock(TEN_O_CLOCK));
    bench.configure(|configuration| configuration.auto_print = true);
    bench.contacts(0x8000_0001);
    bench.contacts(0x0000_0001);
    let printed = String::from_utf8(bench.line()).unwrap();
    assert_eq!(
        printed,
        "0001 2026-11-22 10:00:00.001  1 ON  32 ON\r\n0002 2026-11-22 10:00:00.002  32 OFF\r\n"
    );
}

#[test]
fn a_printer_that_falls_behind_is_told_what_is_missing() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| {
        configuration.size = 2;
        configuration.auto_print = true;
    });
    bench.events(9);
    let printed = String::from_utf8(bench.line()).unwrap();
    let lines: Vec<_> = printed.lines().collect();
    assert_eq!(lines[0], "*** 7 EVENTS NOT PRINTED ***");
    assert_eq!(lines.len(), 3);
    assert_eq!(bench.diagnostics().events_unprinted, 7);
}

#[test]
fn input_changes_that_could_not_be_recorded_are_printed_as_such() {
    let mut bench = Bench::new(Model::Ser160);
    bench.configure(|configuration| configuration.auto_print = true);
    for _ in 0..300 {
        bench.tick_ms += 1;
        bench.inputs ^= 1;
        bench.capture.sample(bench.tick_ms, bench.inputs);
    }
    bench.node.poll(bench.tick_ms);
    let printed = String::from_utf8(bench.line()).unwrap();
    assert!(printed.starts_with("*** 44 INPUT CHANGES NOT RECORDED ***\r\n0001 "), "{printed}");
    assert_eq!(bench.diagnostics().edges_lost, 44);
}

#[test]
fn print_entries_is_answered_at_once_and_the_lines_follow() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(5);
    bench.send(FrameEncoder::new(Command::Print { start: 4, count: 100 }.to_body()));
    bench.send(FrameEncoder::new(Command::QueryMode.to_body()));
    let line = bench.line();
    let text = line.iter().rposition(|&byte| byte == ser_proto::ESC).unwrap() + 11;
    assert!(matches!(replies(&line[..text])[..], [Reply::PrintAccepted, Reply::Mode(_)]));
    let printed = String::from_utf8(line[text..].to_vec()).unwrap();
    assert_eq!(printed.lines().map(|line| &line[..4]).collect::<Vec<_>>(), ["0004", "0005"]);
}

#[test]
fn a_print_job_that_finds_no_place_is_refused_by_silence() {
    let mut bench = Bench::new(Model::Ser160);
    for _ in 0..5 {
        bench.send(FrameEncoder::new(Command::Print { start: 1, count: 1 }.to_body()));
    }
    assert_eq!(replies(&bench.line()).len(), 4);
    assert_eq!(bench.diagnostics().commands_overrun, 1);
}

#[test]
fn print_out_of_range_prints_what_exists() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(2);
    for (start, count) in [(0, 5), (3, 5), (2049, 1), (1, 0)] {
        assert_eq!(bench.ask(&Command::Print { start, count }), [Reply::PrintAccepted]);
    }
}

// L: last broadcast

#[test]
fn without_a_broadcast_the_last_one_is_all_zero() {
    let mut bench = Bench::new(Model::Ser160);
    assert_eq!(bench.ask(&Command::LastBroadcast), [Reply::LastBroadcast(None)]);
}

// Bad input

#[test]
fn every_malformed_frame_is_dropped_and_counted_and_the_next_good_one_answered() {
    type Counter = fn(&mut Diagnostics) -> &mut u32;
    let malformed: [(&[u8], Counter); 9] = [
        (b"\x1B0145", |d| &mut d.frames_interrupted),
        (b"\x1B01G5", |d| &mut d.frames_not_hex),
        (b"\x1B014546", |d| &mut d.frames_checksum),
        (b"\x1BFF", |d| &mut d.frames_too_long),
        (b"\x1B0000", |d| &mut d.frames_empty),
        (b"\x1B015858", |d| &mut d.commands_unknown),
        (b"\x1B02450045", |d| &mut d.commands_wrong_length),
        (b"\x1B024D0956", |d| &mut d.parameters_refused),
        (b"\x1B0953200000000000000073", |d| &mut d.parameters_refused),
    ];
    for (bytes, counter) in malformed {
        let mut bench = Bench::new(Model::Ser160);
        bench.send(bytes.iter().copied());
        bench.line();
        bench.send(*b"\x1B014C4C");
        assert_eq!(replies(&bench.line()), [Reply::LastBroadcast(None)], "after {bytes:X?}");
        // Each is counted once, and under no other name.
        let mut expected = Diagnostics::default();
        *counter(&mut expected) = 1;
        assert_eq!(bench.diagnostics(), expected, "after {bytes:X?}");
    }
}

#[test]
fn commands_beyond_the_waiting_line_are_counted_not_carried_out() {
    let mut bench = Bench::new(Model::Ser160);
    bench.events(3);
    for _ in 0..16 {
        bench.send(FrameEncoder::new(Command::QueryMode.to_body()));
    }
    bench.send(FrameEncoder::new(Command::Erase.to_body()));
    assert_eq!(replies(&bench.line()).len(), 16);
    assert_eq!(bench.diagnostics().commands_overrun, 1);
    assert_eq!(bench.read(1, 0).total, 3);
}

#[test]
fn what_is_no_command_needs_no_place_in_line() {
    let mut bench = Bench::new(Model::Ser160);
    for _ in 0..16 {
        bench.send(FrameEncoder::new(Command::QueryMode.to_body()));
    }
    bench.send(*b"\x1B015858");
    assert_eq!(
        (bench.diagnostics().commands_unknown, bench.diagnostics().commands_overrun),
        (1, 0)
    );
}

#[test]
fn a_wrong_length_is_ignored_whatever_the_values_are() {
    let mut bench = Bench::new(Model::Ser160);
    bench.send(*b"\x1B0343FFFF41");
    assert_eq!(bench.line(), b"");
    assert_eq!(
        (bench.diagnostics().commands_wrong_length, bench.diagnostics().parameters_refused),
        (1, 0)
    );
}

#[test]
fn bytes_that_the_line_lost_are_counted() {
    let mut bench = Bench::new(Model::Ser160);
    bench.node.serial_line_errors(1);
    bench.node.serial_line_errors(2);
    assert_eq!(bench.diagnostics().line_errors, 3);
}
