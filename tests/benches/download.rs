//! How long it takes to read a full log over RS-232, beside the least that it could take, at every
//! rate.
//!
//! In virtual time: the numbers are the same on every computer.

use std::time::Duration;

use ser_proto::{Baud, MAX_SIZE, Model};
use ser_trial::download::Download;

fn main() {
    println!("Reading a full log of {MAX_SIZE} entries over RS-232, in virtual time.\n");
    println!(
        "limit    the fewest reply frames that hold the log, ten entries in each, and nothing else"
    );
    println!(
        "reached  from the first bit of the first request to the delivery of the last event\n"
    );
    println!(
        "                                             two requests under way    one at a time"
    );
    println!(
        "model     bit/s  reply bytes    limit s      reached s   of limit    reached s   of limit"
    );
    for (name, model) in [("ser160", Model::Ser160), ("ser320", Model::Ser320)] {
        for baud in Baud::ALL {
            let [two, one] =
                [false, true].map(|one_at_a_time| Download::run(model, baud, one_at_a_time));
            println!(
                "{name}  {:>7}  {:>11}  {:>9}    {:>11}  {:>7.1} %  {:>11}  {:>7.1} %",
                baud.bits_per_second(),
                two.least_bytes,
                seconds(two.least),
                seconds(two.took),
                two.percent(),
                seconds(one.took),
                one.percent(),
            );
        }
    }
}

fn seconds(time: Duration) -> String {
    format!("{:.2}", time.as_secs_f64())
}
