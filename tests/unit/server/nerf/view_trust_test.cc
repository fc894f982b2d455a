#include "server/nerf/view_trust.h"

#include <gtest/gtest.h>

#include <vector>

namespace romap::nerf::view_trust_test {

ProbeReport Report(size_t views, ViewResidual ordinary = {0.02f, 0.05f, 0.01f}) {
  return {std::vector<ViewResidual>(views, ordinary)};
}

ViewTrust WithViews(size_t views) {
  ViewTrust trust;
  for (size_t i = 0; i < views; ++i) trust.OnView(i, 0);
  return trust;
}

TEST(ViewTrustTest, AnOutlierIsUntrustedUntilItsResidualIsNormal) {
  for (const ViewResidual outlier : {ViewResidual{0.02f, 0.6f, 0.0f}, {0.02f, 0.0f, 0.6f}, {0.5f, 0.05f, 0.01f}}) {
    ViewTrust trust = WithViews(10);
    ProbeReport report = Report(10);
    report.views[3] = outlier;
    EXPECT_TRUE(trust.Update(report, 50));
    for (size_t i = 0; i < 10; ++i) EXPECT_EQ(trust.trusted(i), i != 3);
    EXPECT_EQ(trust.Weights()[3], 0.0f);
    EXPECT_EQ(trust.Weights()[4], 1.0f);
    EXPECT_FALSE(trust.Update(report, 75)) << "unchanged";
    EXPECT_TRUE(trust.Update(Report(10), 100));
    EXPECT_TRUE(trust.trusted(3));
  }
}

TEST(ViewTrustTest, LimitsFollowTheMedianResidual) {
  ViewTrust trust = WithViews(10);
  ProbeReport report = Report(10, {0.1f, 0.2f, 0.05f});
  report.views[3] = {0.25f, 0.45f, 0.1f};
  EXPECT_FALSE(trust.Update(report, 50));
}

TEST(ViewTrustTest, TrustHasHysteresis) {
  ViewTrust trust = WithViews(10);
  ProbeReport report = Report(10);
  report.views[3].missing = 0.36f;  // the limit is 0.15 + 3 * 0.06
  EXPECT_TRUE(trust.Update(report, 50));
  report.views[3].missing = 0.3f;
  EXPECT_FALSE(trust.Update(report, 75));
  EXPECT_FALSE(trust.trusted(3));
}

TEST(ViewTrustTest, NewViewsAreTrustedForSomeSteps) {
  ViewTrust trust = WithViews(10);
  ProbeReport report = Report(11);
  report.views[10] = {0.8f, 0.8f, 0.0f};
  trust.OnView(10, 100);
  EXPECT_FALSE(trust.Update(report, 125));
  EXPECT_TRUE(trust.Update(report, 150));
  EXPECT_FALSE(trust.trusted(10));
  trust.OnView(10, 150);  // its pose was corrected
  EXPECT_TRUE(trust.trusted(10));
}

TEST(ViewTrustTest, FewViewsOrManyOutliersChangeNothing) {
  ViewTrust few = WithViews(5);
  ProbeReport report = Report(5);
  report.views[1] = {0.8f, 0.8f, 0.0f};
  EXPECT_FALSE(few.Update(report, 500));
  ViewTrust many = WithViews(9);
  report = Report(9);
  for (size_t i = 0; i < 4; ++i) report.views[i] = {0.8f, 0.8f, 0.0f};
  EXPECT_FALSE(many.Update(report, 500));
  EXPECT_EQ(many.Weights(), std::vector<float>(9, 1.0f));
}

TEST(ViewTrustTest, RestartTrustsAllViews) {
  ViewTrust trust = WithViews(10);
  ProbeReport report = Report(10);
  report.views[3].missing = 1;
  EXPECT_TRUE(trust.Update(report, 50));
  trust.Restart();
  EXPECT_TRUE(trust.trusted(3));
  EXPECT_FALSE(trust.Update(report, 25));
}

}  // namespace romap::nerf::view_trust_test
