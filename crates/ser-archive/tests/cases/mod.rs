//! What holds for every archive, wherever it is: small cases, each with an archive of its own.

pub(crate) mod kept;
#[cfg(all(unix, feature = "postgres"))]
mod needs_postgres;
pub(crate) mod sound;
pub(crate) mod writer;

use crate::common::Home;

/// A case, by its name.
pub(crate) type Case = (&'static str, fn(&Home));

/// Makes a list of all cases, and a test of each with an archive in a file.
macro_rules! cases {
    ($($file:ident: [$($case:ident),* $(,)?],)*) => {
        pub(crate) const ALL: &[Case] = &[$($((stringify!($case), $file::$case),)*)*];

        mod in_a_file {
            $($(
                #[test]
                fn $case() {
                    super::$file::$case(&super::Home::new());
                }
            )*)*
        }
    };
}

cases! {
    kept: [
        what_was_added_is_given_back_and_added_again_changes_nothing,
        two_collectors_that_read_the_same_add_it_once,
        another_content_at_the_same_place_is_kept_beside_it,
        a_conflict_within_one_batch_is_one_too,
        the_number_in_the_ring_is_no_part_of_what_an_entry_is,
        a_bookmark_moves_with_what_was_read_or_not_at_all,
        what_could_not_be_read_again_is_not_added,
        a_window_is_by_what_the_recorder_showed_and_an_impossible_stamp_is_in_each,
        remarks_and_versions_of_the_site_file_are_kept_as_they_are,
        an_excerpt_shows_what_is_missing_beside_it_and_says_what_it_leaves_out,
        the_last_time_that_an_input_went_on_is_found_whatever_clocks_showed,
        a_life_is_found_by_an_entry_of_it,
        a_life_with_two_names_is_filed_once,
        a_life_that_contradicts_another_is_not_that_one,
        what_one_collector_tells_apart_stays_apart,
        of_several_lives_the_one_with_most_in_common_is_taken,
        who_moves_to_an_archive_that_was_given_his_rows_goes_on_there,
        an_impossible_stamp_tells_a_life_as_well,
        what_an_outlet_does_not_have_is_not_let_go,
        who_reads_while_others_write_misses_nothing_and_sees_no_contradiction,
        an_archive_of_a_newer_program_is_refused_by_name,
    ],
    sound: [
        a_number_that_is_not_there_is_a_hole_unless_it_was_told,
        what_was_watched_must_be_there,
        where_a_log_began_is_not_known_if_its_total_had_wrapped,
        heads_are_what_verification_finds_and_earlier_ones_are_known_again,
        a_tail_that_is_taken_away_shows_in_the_head_that_was_written_down,
        what_is_let_go_is_told_and_the_rest_stays_proven,
        what_another_collector_adds_late_is_no_contradiction,
        entries_that_collectors_add_in_turn_become_one_gap,
        neighbouring_gaps_become_one_in_time,
        a_conflict_that_was_let_go_is_one_still,
        all_may_be_let_go,
        a_life_of_which_nothing_is_left_has_no_hole_before_its_first_entry,
        an_archive_that_is_too_large_loses_its_oldest,
        evidence_that_is_too_large_alone_takes_no_entry_with_it,
        a_clock_that_was_wrong_takes_no_more_than_is_too_much,
        many_small_batches_are_let_go,
        numbers_that_no_log_has_are_damage_and_no_more,
        a_row_that_somebody_changed_is_found,
    ],
    writer: [
        what_many_threads_add_is_there_when_they_are_told_so,
        one_that_cannot_be_written_keeps_nobody_else_from_it,
        who_asked_may_go_away_and_it_is_written_all_the_same,
    ],
}

/// A case that is in no list would never be tried.
#[test]
fn every_case_is_in_the_list() {
    let sources = [include_str!("kept.rs"), include_str!("sound.rs"), include_str!("writer.rs")];
    let written: usize = sources.iter().map(|source| source.matches("home: &Home").count()).sum();
    assert_eq!(ALL.len(), written);
}
