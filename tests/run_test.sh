#!/bin/sh
# run_test.sh NAME gtest|pytest COMMAND...: runs one of the suites; where CLSP_TEST_RESULTS names a folder, a JUnit file
# of its single tests goes there, so that a test that skips itself does not go unseen.
name=$1
kind=$2
shift 2
if [ -n "$CLSP_TEST_RESULTS" ]; then
    case $kind in
    gtest) export GTEST_OUTPUT="xml:$CLSP_TEST_RESULTS/$name.xml" ;;
    pytest) set -- "$@" "--junitxml=$CLSP_TEST_RESULTS/$name.xml" ;;
    esac
fi
# What the user of this machine has measured is no part of the tests.
export CLSPECKLE_TUNING="${CLSPECKLE_TUNING-off}"
exec "$@"
