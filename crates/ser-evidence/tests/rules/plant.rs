//! The plant: recorders as they are built and wired, and the site that people wrote down of it.

use jiff::tz::TimeZone;
use ser_evidence::site::{
    ClockRule, Delays, Group, GroupId, Point, PointId, Recorder, RecorderId, Site,
};
use ser_proto::Model;

use crate::chance::Chance;
use crate::contact::Contact;
use crate::input::Wire;
use crate::recorder::{Build, SamplePlace, SetTakesEffect};
use crate::schedule::Schedule;
use crate::true_clock::Rates;
use crate::true_time::{MS, Ps, US};

/// Recorders, and what the site file says of them. `now_ms` is UTC when the world begins.
pub(crate) fn draw(
    now_ms: i64,
    moments: &[Ps],
    until: Ps,
    hosts_ppb: u32,
    chance: &mut Chance,
) -> (Site, Vec<Build>) {
    let count = chance.below(6) + 1;
    let set_takes_effect = chance.of(&[SetTakesEffect::AtOnce, SetTakesEffect::AtNextTick]);
    let mut builds: Vec<Build> = (0..count)
        .map(|number| build(number, set_takes_effect, now_ms, moments, until, hosts_ppb, chance))
        .collect();
    wire(&mut builds, chance);
    let recorders = builds.iter().map(|build| build.site.clone()).collect();
    let groups =
        ["Feeder 1", "Feeder 2"].map(|name| Group { name: name.to_owned(), first_out: true });
    let time_zone = TimeZone::UTC;
    let mut site = Site {
        name: "World".to_owned(),
        time_zone,
        recorders,
        groups: groups.to_vec(),
        ..Site::unknown()
    };
    site.points = points(&builds, chance);
    (site, builds)
}

/// The levels of all inputs when the world begins.
pub(crate) fn with_first_states(mut builds: Vec<Build>, contacts: &[Contact]) -> Vec<Build> {
    for wire in builds.iter_mut().flat_map(|build| &mut build.wires) {
        wire.is_on_at_first = contacts[wire.contact].is_closed_at_first != wire.is_inverted;
    }
    builds
}

fn build(
    number: usize,
    set_takes_effect: SetTakesEffect,
    now_ms: i64,
    moments: &[Ps],
    until: Ps,
    hosts_ppb: u32,
    chance: &mut Chance,
) -> Build {
    let is_original = chance.one_in(4);
    let drift_ppb = chance.of(&[1000, 20_000, 50_000, 200_000]);
    let wander_ppb = chance.of(&[0, 1000, 5000]);
    let clock = match chance.below(3) {
        0 => ClockRule::Utc,
        1 => ClockRule::Local,
        _ => ClockRule::Offset(3600),
    };
    let model = chance.of(&[Model::Ser160, Model::Ser320]);
    let size = chance.of(&[4, 16, 100, 1024]);
    let site = Recorder {
        model: chance.one_in(2).then_some(model),
        log_size: is_original.then_some(size),
        is_original,
        clock,
        // As its hosts see it, with what both make of each other.
        drift_ppb: drift_ppb + hosts_ppb + hosts_ppb.div_ceil(1000),
        wander_ppb,
        delays: delays(chance),
        ..Recorder::named(format!("SER{}", number + 1))
    };
    let sample_place = match (is_original, chance.below(3)) {
        (false, _) => SamplePlace::AtTheTick,
        (true, 0) => SamplePlace::Anywhere(chance.bits()),
        (true, 1) => SamplePlace::Later(MS - US),
        (true, _) => SamplePlace::Later(chance.between(0, MS - US)),
    };
    Build {
        site,
        model,
        size,
        wires: Vec::new(),
        sample_place,
        set_takes_effect,
        rate_ppb: Rates { drift_ppb, wander_ppb }.draw(chance),
        own_drift_ppb: drift_ppb,
        schedule: Schedule::draw(moments, until, now_ms, chance),
        first_total: chance.of(&[0, 0, 7, 65_530, 200_000]),
    }
}

/// Those of the hardware guide, none at all, or those of slow relays.
fn delays(chance: &mut Chance) -> Delays {
    match chance.below(4) {
        0 => Delays { closing_us: (0, 0), opening_us: (0, 0) },
        1 => {
            let mut pair = || {
                let shortest = chance.between(0, 3000);
                let longest = shortest + chance.between(0, 4000);
                let small = |us| u32::try_from(us).expect("not negative");
                (small(shortest), small(longest))
            };
            Delays { closing_us: pair(), opening_us: pair() }
        }
        _ => Delays::default(),
    }
}

/// Wires contacts to inputs, some to two recorders.
fn wire(builds: &mut [Build], chance: &mut Chance) {
    let count = builds.len() + chance.below(6);
    for contact in 0..count {
        // Each recorder has at least one.
        let first = if contact < builds.len() { contact } else { chance.below(builds.len()) };
        let second = chance.below(builds.len());
        add_wire(&mut builds[first], contact, false, chance);
        if second != first && chance.one_in(2) {
            add_wire(&mut builds[second], contact, chance.one_in(2), chance);
        }
    }
}

fn add_wire(build: &mut Build, contact: usize, is_inverted: bool, chance: &mut Chance) {
    let inputs = build.model.inputs();
    let is_free = |&input: &u8| build.wires.iter().all(|wire| wire.input != input);
    let free: Vec<u8> = (1..=inputs).filter(is_free).collect();
    let input = chance.of(&free);
    build.wires.push(Wire { input, contact, is_inverted, is_on_at_first: false });
}

/// What people wrote down. Now and then they forgot an input.
fn points(builds: &[Build], chance: &mut Chance) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::new();
    let mut of_contact: Vec<(usize, bool)> = Vec::new();
    for (recorder, build) in builds.iter().enumerate() {
        for wire in &build.wires {
            if chance.one_in(8) {
                continue;
            }
            let group = if chance.one_in(4) { None } else { Some(GroupId(chance.below(2))) };
            let partner = of_contact.iter().position(|&(contact, _)| contact == wire.contact);
            // As a site file that was read has it: either names the other.
            if let Some(partner) = partner {
                points[partner].same_as = Some(PointId(points.len()));
            }
            let inverted = partner.is_some_and(|at| of_contact[at].1 != wire.is_inverted);
            points.push(Point {
                recorder: RecorderId(recorder),
                input: wire.input,
                name: format!("contact {} at input {}", wire.contact, wire.input),
                role: None,
                equipment: None,
                group,
                on: "ON".to_owned(),
                off: "OFF".to_owned(),
                normal: None,
                same_as: partner.map(PointId),
                inverted,
            });
            of_contact.push((wire.contact, wire.is_inverted));
        }
    }
    points
}
