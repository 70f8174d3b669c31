"""Random mechanisms against themselves: every balance, and both routes to the drive."""

from hypothesis import given, settings

from blockmech.testing.strategies import EVERY, Options, mechanisms

BALANCE = 1e-12  # what `verify` allows, of the sum of absolute terms times its conditioning


@given(mechanisms(Options(kinds=EVERY, groups=(1, 4), drivers=(1, 3))))
@settings(max_examples=30)
def test_balances_and_both_routes_to_the_drive_hold_on_random_mechanisms(case):
    mech = case.graph.compile()
    found = mech.verify(**case.request)
    if found.samples == 0:  # no friction solution: the balances are judged without
        found = mech.verify(**case.request, friction="none")
    assert found.ok, str(found)
    assert max(row.allowed for row in found.rows) <= BALANCE
