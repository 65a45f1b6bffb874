//! What `watch` delivers and loses while events come faster and faster, for rings of several sizes.
//!
//! In virtual time: the numbers are the same on every computer.

use ser_trial::watching::{Load, Way, line_carries};

const SECONDS: u32 = 60;

fn main() {
    let carried = line_carries();
    println!(
        "Events for {SECONDS} s, 16 inputs, 19200 bit/s; the line carries {carried:.1} events/s.\n"
    );
    println!("delivered  events a second that are delivered by the time that the last one happens");
    println!(
        "lost       overwritten before they could be read, and told to be; all others are \
         delivered\n"
    );
    println!("                     watch                         watch --poll");
    println!("events/s  ring       delivered   of possible  lost   delivered   of possible  lost");
    for per_second in [10, 20, 40, 60, 70, 80, 100, 200, 500, 1000] {
        for size in [64, 128, 256, 1024, 2048] {
            print!("{per_second:>8}  {size:>4}");
            for way in [Way::Reports, Way::Polling] {
                let watched = Load { way, size, per_second, seconds: SECONDS }.run();
                let rate = watched.in_time as f64 / f64::from(SECONDS);
                let percent = 100.0 * rate / carried.min(per_second.into());
                print!("   {rate:>13.1}  {percent:>9.1} %  {:>5}", watched.lost);
            }
            println!();
        }
    }
}
